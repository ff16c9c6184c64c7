// Solving from the mosaic against solving from interpolated colours: time and error in memory, time
// from files to maps against LibRaw alone, memory and time of a large capture. `--full` takes the
// sizes of the bars: 16 and 150 megapixels, five minutes, 4 GB in the folder for scratch files.
#include <fmt/format.h>
#include <libraw/libraw.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/files/file_io.h"
#include "core/files/output_folder.h"
#include "core/files/own_folder.h"
#include "core/parallel.h"
#include "core/sha256.h"
#include "imaging/dng.h"
#include "imaging/raw.h"
#include "rig/projection.h"
#include "rig/rig.h"
#include "scanner/sessions/session.h"
#include "simulation/random.h"
#include "simulation/rigs.h"
#include "solver/evaluate.h"
#include "solver/ladder.h"
#include "solver/mosaic/mosaic.h"

namespace {

namespace fs = std::filesystem;

using sateen::Image;
using sateen::ImageSize;
using sateen::NormalField;

constexpr ImageSize kSmall = {1232, 816};
constexpr ImageSize kSixteenMegapixels = {4928, 3264};
constexpr ImageSize kHundredFiftyMegapixels = {14208, 10560};
constexpr double kBlackDn = 600.0;
constexpr double kWhiteDn = 16383.0;
constexpr double kElectrons = 45000.0;
constexpr double kReadElectrons = 4.0;
constexpr double kGainDn = (kWhiteDn - kBlackDn) / kElectrons;
constexpr double kReadDn = kReadElectrons * kGainDn;
constexpr double kFullScale = 0.7;  // radiance at saturation
constexpr double kPerDn = kFullScale / (kWhiteDn - kBlackDn);
constexpr std::array<uint8_t, 4> kRggb = {0, 1, 1, 2};
constexpr std::array<double, 3> kAlbedo = {0.6, 0.5, 0.35};
constexpr double kRipplePx = 40.0;
constexpr double kRippleSlope = 0.5;

bool all_met = true;

void Row(const std::string& what, const std::string& measured, const std::string& bar, bool met) {
  all_met = all_met && met;
  fmt::print("{:<44} {:<52} {:<24} {}\n", what, measured, bar, met ? "met" : "NOT MET");
  std::fflush(stdout);
}

double SecondsOf(const std::function<void()>& run) {
  const auto start = std::chrono::steady_clock::now();
  run();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double BestOf(int repeats, const std::function<void()>& run) {
  double best = 1e9;
  for (int i = 0; i < repeats; ++i) {
    best = std::min(best, SecondsOf(run));
  }
  return best;
}

// A rippled cloth under ten near lights, as a 14-bit sensor reads it.
class Capture {
 public:
  explicit Capture(ImageSize size) : size_(size), rig_(sateen::RingRig(size)) {
    rig_.response = sateen::Response{.black = kBlackDn,
                                     .white = kWhiteDn,
                                     .read_noise_dn = kReadDn,
                                     .gain_dn_per_electron = kGainDn};
    origin_ = *TablePointOfPixel(*rig_.camera, 0.0, 0.0);
    right_ = *TablePointOfPixel(*rig_.camera, 1.0, 0.0) - origin_;
    down_ = *TablePointOfPixel(*rig_.camera, 0.0, 1.0) - origin_;
    for (size_t j = 0; j < deviates_.size(); ++j) {
      deviates_[j] = static_cast<float>(sateen::NormalDeviate(1, j));
    }
  }
  [[nodiscard]] const sateen::Rig& GetRig() const { return rig_; }
  [[nodiscard]] ImageSize Size() const { return size_; }

  [[nodiscard]] static Eigen::Vector3d NormalAt(double x, double y) {
    const double across = 2.0 * std::numbers::pi / kRipplePx;
    return Eigen::Vector3d(-kRippleSlope * std::cos(across * x) * std::sin(across * y),
                           -kRippleSlope * std::sin(across * x) * std::cos(across * y), 1.0)
        .normalized();
  }

  [[nodiscard]] Image<uint16_t> Expose(size_t light) const {
    Image<uint16_t> readings(size_);
    static_cast<void>(sateen::ParallelFor(size_.height, 16, {}, [&](int begin, int end) {
      for (int y = begin; y < end; ++y) {
        for (int x = 0; x < size_.width; ++x) {
          readings.At(x, y) = ReadingAt(light, x, y);
        }
      }
    }));
    return readings;
  }
  [[nodiscard]] sateen::Image3 Normals() const {
    sateen::Image3 normal(size_);
    for (int y = 0; y < size_.height; ++y) {
      for (int x = 0; x < size_.width; ++x) {
        const Eigen::Vector3d n = NormalAt(x, y);
        for (size_t c = 0; c < 3; ++c) {
          normal[c].At(x, y) = static_cast<float>(n[static_cast<Eigen::Index>(c)]);
        }
      }
    }
    return normal;
  }

 private:
  [[nodiscard]] uint16_t ReadingAt(size_t light, int x, int y) const {
    const sateen::Light& lamp = rig_.lights[light];
    const Eigen::Vector3d to_light = lamp.position_mm - (origin_ + x * right_ + y * down_);
    const double squared = to_light.squaredNorm();
    const size_t c = kRggb[static_cast<size_t>(y % 2 * 2 + x % 2)];
    const double cosine = std::max(0.0, NormalAt(x, y).dot(to_light) / std::sqrt(squared));
    const double radiance =
        kAlbedo[c] * lamp.flux_rgb[static_cast<Eigen::Index>(c)] * 1e6 / squared * cosine;
    const double signal = radiance / kPerDn;
    const uint64_t place =
        sateen::MixBits(light * size_.PixelCount() + static_cast<uint64_t>(y) * size_.width + x);
    const double noise = std::sqrt(kGainDn * signal + kReadDn * kReadDn) *
                         static_cast<double>(deviates_[place % deviates_.size()]);
    return static_cast<uint16_t>(
        std::clamp(std::lround(kBlackDn + signal + noise), 0L, std::lround(kWhiteDn)));
  }

  ImageSize size_;
  sateen::Rig rig_;
  Eigen::Vector3d origin_;
  Eigen::Vector3d right_;
  Eigen::Vector3d down_;
  std::vector<float> deviates_ = std::vector<float>(1 << 20);
};

sateen::LightStack Demosaiced(const std::vector<Image<uint16_t>>& readings) {
  sateen::LightStack stack(readings.size());
  static_cast<void>(
      sateen::ParallelFor(static_cast<int>(readings.size()), 1, {}, [&](int begin, int /*end*/) {
        const auto k = static_cast<size_t>(begin);
        sateen::RawMosaic mosaic{.samples = Image<float>(readings[k].Size()), .cfa = kRggb};
        std::ranges::transform(
            readings[k].pixels, mosaic.samples.pixels.begin(), [](uint16_t reading) {
              return static_cast<float>((static_cast<double>(reading) - kBlackDn) * kPerDn);
            });
        stack[k] = {.rgb = sateen::Demosaic(mosaic),
                    .full_scale = static_cast<float>(kFullScale),
                    .name = "frame",
                    .raw = true};
      }));
  return stack;
}

sateen::MosaicStack StackOf(std::vector<Image<uint16_t>> readings, ImageSize size) {
  sateen::MosaicFrame frame{.saturated_dn = static_cast<float>(kWhiteDn),
                            .gain_dn = kGainDn,
                            .read_dn = kReadDn,
                            .name = "frame"};
  frame.per_dn.fill(static_cast<float>(kPerDn));
  frame.at_zero.fill(static_cast<float>(-kBlackDn * kPerDn));
  return {.size_px = size,
          .cfa = kRggb,
          .lit = std::vector<sateen::MosaicFrame>(readings.size(), frame),
          .rows = std::make_shared<sateen::MosaicsInMemory>(std::move(readings))};
}

void MeasureInMemory(ImageSize size, int repeats) {
  const Capture capture(size);
  const sateen::Rig& rig = capture.GetRig();
  std::vector<Image<uint16_t>> readings;
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    readings.push_back(capture.Expose(k));
  }
  const sateen::Image3 truth = capture.Normals();
  const sateen::MosaicStack mosaics = StackOf(readings, size);
  NormalField field;
  const auto ns = [&](double seconds) {
    return 1e9 * seconds / static_cast<double>(size.PixelCount());
  };
  const auto show = [&](const char* what, double seconds) {
    fmt::print("{:<44} {:>8.1f} ns/px {:>8.4f} deg\n", what, ns(seconds),
               sateen::AngularErrorDeg(field, truth)->mean);
    return seconds;
  };
  fmt::print("{} x {} px, {} near lights, mosaics in memory\n", size.width, size.height,
             readings.size());
  sateen::LightStack stack;
  const double colours = BestOf(repeats, [&] { stack = Demosaiced(readings); });
  fmt::print("{:<44} {:>8.1f} ns/px\n", "interpolating the colours", ns(colours));
  const double rgb =
      show("least squares, from colours", BestOf(repeats, [&] {
             static_cast<void>(SolveLambertianInto(stack, rig, std::nullopt, {}, {}, field));
           }));
  const sateen::LadderOptions with_noise{.noise = NoiseOf(stack, rig)};
  const double rgb_ladder =
      show("ladder, from colours", BestOf(repeats, [&] {
             static_cast<void>(SolveLadderInto(stack, rig, std::nullopt, with_noise, {}, field));
           }));
  stack.clear();
  const auto from_mosaics = [&](const char* what, const sateen::MosaicOptions& options) {
    return show(
        what, BestOf(repeats, [&] {
          static_cast<void>(SolveMosaicInto(mosaics, rig, std::nullopt, options, {}, field));
        }));
  };
  const double raw = from_mosaics("least squares, from mosaics", {.mode = std::nullopt});
  const double raw_ladder = from_mosaics("ladder, from mosaics", {});
  const auto compare = [&](const char* what, double mosaic, double solve) {
    Row(what,
        fmt::format("{:.2f} of the time; {:.2f} of the solve without interpolating",
                    mosaic / (colours + solve), mosaic / solve),
        "0.35", mosaic <= 0.35 * (colours + solve));
  };
  compare("least squares from mosaics", raw, rgb);
  compare("ladder from mosaics", raw_ladder, rgb_ladder);
}

// Writes a session of DNG files; false if the disk is too small.
bool WriteSession(const Capture& capture, const fs::path& dir) {
  sateen::Rig rig = capture.GetRig();
  // Files hold the fraction of full scale, divided by the exposure.
  const sateen::SessionFrame exposure{.exposure_s = 0.02, .f_number = 8.0, .iso = 100.0};
  for (sateen::Light& light : rig.lights) {
    light.flux_rgb /= kFullScale * exposure.Exposure();
  }
  sateen::Session session{.rig = "rig.json"};
  fs::create_directories(dir / "frames");
  for (size_t k = 0; k < rig.lights.size(); ++k) {
    sateen::SessionFrame frame = exposure;
    frame.light = rig.lights[k].name;
    frame.file = fmt::format("frames/{}.dng", k);
    if (!sateen::WriteDng(dir / frame.file, capture.Expose(k),
                          {.cfa = kRggb, .black = kBlackDn, .white = kWhiteDn})) {
      return false;
    }
    session.frames.push_back(frame);
  }
  const std::string rig_json = sateen::RigToJson(rig);
  session.rig_sha256 = sateen::Sha256(rig_json);
  return sateen::WriteFileWhole(dir / "rig.json", rig_json) &&
         sateen::WriteFileWhole(dir / "session.json", sateen::SessionToJson(session));
}

struct Run {
  double seconds = 0.0;
  double peak_mib = 0.0;
  bool is_good = false;
};

Run Solve(const fs::path& session, const fs::path& maps) {
  const std::string program = SATEEN_PROGRAM_DIR "/sateen";
  Run run;
  rusage used = {};
  int status = -1;
  run.seconds = SecondsOf([&] {
    const pid_t child = fork();
    if (child == 0) {
      std::freopen("/dev/null", "w", stdout);
      execl(program.c_str(), "sateen", "solve", session.c_str(), "-o", maps.c_str(), nullptr);
      _exit(127);
    }
    wait4(child, &status, 0, &used);
  });
  run.peak_mib = static_cast<double>(used.ru_maxrss) / 1024.0;
  run.is_good = status == 0;
  return run;
}

// Returns the time of LibRaw to unpack the files and interpolate their colours, on as many threads.
double LibRawSeconds(const fs::path& session) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(session / "frames")) {
    files.push_back(entry.path());
  }
  return SecondsOf([&] {
    static_cast<void>(
        sateen::ParallelFor(static_cast<int>(files.size()), 1, {}, [&](int begin, int /*end*/) {
          const auto raw = std::make_unique<LibRaw>();
          libraw_output_params_t& params = raw->imgdata.params;
          params.user_qual = 0;     // bilinear
          params.output_color = 0;  // as the camera has it
          params.output_bps = 16;
          params.no_auto_bright = 1;
          params.gamm[0] = params.gamm[1] = 1.0;
          std::ranges::fill(params.user_mul, 1.0F);
          const std::string& name = files[static_cast<size_t>(begin)].native();
          if (raw->open_file(name.c_str()) != LIBRAW_SUCCESS || raw->unpack() != LIBRAW_SUCCESS ||
              raw->dcraw_process() != LIBRAW_SUCCESS) {
            fmt::print("  LibRaw cannot read {}\n", name);
          }
        }));
  });
}

Run MeasureFiles(ImageSize size, const fs::path& folder, int repeats) {
  const fs::path session = folder / "session";
  if (!WriteSession(Capture(size), session)) {
    Row("from files to maps", "the session cannot be written", "", false);
    return {};
  }
  double libraw = 1e9;
  Run best{.seconds = 1e9};
  for (int i = 0; i < repeats; ++i) {
    libraw = std::min(libraw, LibRawSeconds(session));
    if (const Run run = Solve(session, folder / "maps"); run.seconds < best.seconds) {
      best = run;
    }
  }
  Row(fmt::format("ten DNG files of {:.0f} megapixels to maps",
                  1e-6 * static_cast<double>(size.PixelCount())),
      fmt::format("{:.2f} s, LibRaw alone {:.2f} s: {:.2f}; {:.0f} MiB", best.seconds, libraw,
                  best.seconds / libraw, best.peak_mib),
      "1.6", best.is_good && best.seconds <= 1.6 * libraw);
  fs::remove_all(session);
  fs::remove_all(folder / "maps");
  return best;
}

void MeasureLarge(ImageSize size, const Run& small, ImageSize small_size, const fs::path& folder) {
  const fs::path session = folder / "large";
  if (!WriteSession(Capture(size), session)) {
    Row("a large capture", "cannot be written; make room, or --folder", "", false);
    return;
  }
  Run run = Solve(session, folder / "maps");
  if (const Run again = Solve(session, folder / "maps"); again.seconds < run.seconds) {
    run = again;
  }
  const double ns = 1e9 * run.seconds / static_cast<double>(size.PixelCount());
  const double small_ns = 1e9 * small.seconds / static_cast<double>(small_size.PixelCount());
  const std::string what =
      fmt::format("{:.0f} megapixels", 1e-6 * static_cast<double>(size.PixelCount()));
  Row(what + ", peak memory", fmt::format("{:.0f} MiB", run.peak_mib), "1024 MiB",
      run.is_good && run.peak_mib <= 1024.0);
  Row(what + ", time", fmt::format("{:.0f} ns/px, {:.2f} of the small", ns, ns / small_ns), "1.10",
      run.is_good && ns <= 1.1 * small_ns);
  fs::remove_all(session);
  fs::remove_all(folder / "maps");
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Solving from the mosaic against solving from interpolated colours", "mosaic_bench");
  bool full = false;
  std::string only;
  std::string folder;
  app.add_flag("--full", full, "The sizes of the bars; five minutes");
  app.add_option("--only", only, "memory or files")->check(CLI::IsMember({"memory", "files"}));
  app.add_option("--folder", folder, "Where to write captures and maps, 8 GB with --full");
  CLI11_PARSE(app, argc, argv);
  const ImageSize size = full ? kSixteenMegapixels : kSmall;
  if (only != "files") {
    MeasureInMemory(size, 3);
  }
  if (only != "memory") {
    const sateen::Result<sateen::OwnFolder> scratch = sateen::MakeScratchFolder("mosaic-bench");
    if (!scratch) {
      fmt::print(stderr, "mosaic_bench: error: {}\n", scratch.error().message);
      return 4;
    }
    const fs::path place = folder.empty() ? scratch->Path() : fs::path(folder);
    const Run run = MeasureFiles(size, place, 3);
    MeasureLarge(full ? kHundredFiftyMegapixels : kSixteenMegapixels, run, size, place);
  }
  return all_met ? 0 : 3;
}
