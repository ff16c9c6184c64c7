#include "imaging/raw.h"

#include <libraw/libraw.h>

#include <algorithm>
#include <cctype>
#include <exception>
#include <functional>
#include <memory>
#include <new>
#include <string_view>
#include <utility>

#include "core/check.h"
#include "core/files/input_file.h"
#include "imaging/file_check.h"

namespace sateen {
namespace {

constexpr uint8_t kRed = 0;
constexpr uint8_t kGreen = 1;
constexpr uint8_t kBlue = 2;

// LibRaw numbers the green of the other rows 3.
uint8_t ColourOf(int libraw_colour) {
  return libraw_colour == 3 ? kGreen : static_cast<uint8_t>(libraw_colour);
}

Status CheckDecoded(const std::filesystem::path& path, LibRaw& raw, int open_or_unpack) {
  // Decoders that meet the end of the data may go on with zeros and only count the errors.
  const int damaged = raw.error_count();
  if (open_or_unpack == LIBRAW_SUCCESS && damaged == 0) {
    return {};
  }
  return Fail(ErrorCode::kBadData,
              "{}: cannot be decoded as camera RAW ({}); it is damaged, cut short or of a camera "
              "that LibRaw {} does not know: copy it again, or convert it to DNG",
              path.string(),
              open_or_unpack != LIBRAW_SUCCESS ? LibRaw::strerror(open_or_unpack)
                                               : fmt::format("{} damaged samples", damaged).c_str(),
              LibRaw::version());
}

// Returns what keeps the file from being one integer sample per site under a 2x2 red, green, blue
// pattern; empty if nothing does.
std::string_view NotBayer(LibRaw& raw) {
  const libraw_data_t& data = raw.imgdata;
  const libraw_iparams_t& id = data.idata;
  if (id.is_foveon != 0 || id.filters == 0) {
    return "three colours at every pixel (linear DNG, sRAW or Foveon)";
  }
  if (id.filters == LIBRAW_XTRANS) {
    return "a 6x6 X-Trans pattern";
  }
  if (raw.is_floating_point() != 0) {
    return "floating-point samples";
  }
  const bool rotated = data.rawdata.ioparams.fuji_width != 0;
  if (data.rawdata.raw_image == nullptr || id.filters < 1000 || id.colors != 3 || rotated) {
    return "a pattern that is not 2x2";
  }
  if (data.rawdata.ph1_cblack != nullptr || data.rawdata.ph1_rblack != nullptr) {
    return "a black level for each row or column (Phase One)";
  }
  const auto colour = [&raw](int x, int y) { return ColourOf(raw.COLOR(y, x)); };
  for (int y = 0; y < 8; ++y) {  // LibRaw keeps eight rows of the pattern
    if (colour(0, y) != colour(0, y % 2) || colour(1, y) != colour(1, y % 2)) {
      return "a pattern that is not 2x2";
    }
  }
  const int green_x = colour(0, 0) == kGreen ? 0 : 1;
  const bool bayer = colour(green_x, 0) == kGreen && colour(1 - green_x, 1) == kGreen &&
                     colour(1 - green_x, 0) + colour(green_x, 1) == kRed + kBlue &&
                     colour(1 - green_x, 0) != kGreen;
  return bayer ? "" : "a 2x2 pattern without two greens on a diagonal";
}

// Black is kept in up to three parts: one for all, one for each colour, and a pattern that repeats
// over the visible area (DNG).
float BlackLevel(LibRaw& raw, int x, int y) {
  const libraw_colordata_t& color = raw.imgdata.color;
  unsigned black = color.black + color.cblack[raw.COLOR(y, x)];
  const unsigned rows = color.cblack[4];
  const unsigned columns = color.cblack[5];
  if (rows > 0 && columns > 0) {
    black += color.cblack[6 + (static_cast<unsigned>(y) % rows) * columns +
                          static_cast<unsigned>(x) % columns];
  }
  return static_cast<float>(black);
}

bool BlackRepeatsLikeBayer(LibRaw& raw) {
  const libraw_colordata_t& color = raw.imgdata.color;
  return color.cblack[4] <= 2 && color.cblack[5] <= 2;
}

std::optional<double> IfPositive(float value) {
  return value > 0.0F ? std::optional<double>(value) : std::nullopt;
}

void FillMetadata(const libraw_data_t& data, RawMosaic& mosaic) {
  mosaic.camera = data.idata.make;
  if (data.idata.model[0] != '\0') {
    mosaic.camera += mosaic.camera.empty() ? "" : " ";
    mosaic.camera += data.idata.model;
  }
  mosaic.exposure_s = IfPositive(data.other.shutter);
  mosaic.f_number = IfPositive(data.other.aperture);
  mosaic.iso = IfPositive(data.other.iso_speed);
  const float* gain = data.color.cam_mul;
  if (gain[0] > 0.0F && gain[1] > 0.0F && gain[2] > 0.0F) {
    mosaic.camera_white_balance = {gain[0] / gain[1], 1.0F, gain[2] / gain[1]};
  }
}

// Returns the decoder's readings, or why they are no mosaic that we know.
Result<RawReadings> ReadingsOf(const std::filesystem::path& path, LibRaw& raw) {
  const libraw_image_sizes_t& sizes = raw.imgdata.sizes;
  if (const std::string_view found = NotBayer(raw); !found.empty()) {
    return Fail(ErrorCode::kBadData, "{}: has {}; needed is a 2x2 Bayer mosaic of integers",
                path.string(), found);
  }
  if (sizes.width < 2 || sizes.height < 2 || sizes.left_margin + sizes.width > sizes.raw_width ||
      sizes.top_margin + sizes.height > sizes.raw_height) {
    return Fail(ErrorCode::kBadData,
                "{}: its visible area {}x{}+{}+{} is not inside its {}x{} sites", path.string(),
                sizes.width, sizes.height, sizes.left_margin, sizes.top_margin, sizes.raw_width,
                sizes.raw_height);
  }
  if (!BlackRepeatsLikeBayer(raw)) {
    return Fail(ErrorCode::kBadData, "{}: its black level repeats every {}x{} sites; needed is 2x2",
                path.string(), raw.imgdata.color.cblack[5], raw.imgdata.color.cblack[4]);
  }
  RawReadings readings{.size_px = {sizes.width, sizes.height},
                       .white = static_cast<float>(raw.imgdata.color.maximum),
                       .pitch = sizes.raw_pitch / sizeof(uint16_t)};
  readings.first = raw.imgdata.rawdata.raw_image +
                   readings.pitch * static_cast<size_t>(sizes.top_margin) + sizes.left_margin;
  for (int site = 0; site < 4; ++site) {
    const int x = site % 2;
    const int y = site / 2;
    readings.cfa[static_cast<size_t>(site)] = ColourOf(raw.COLOR(y, x));
    readings.black[static_cast<size_t>(site)] = BlackLevel(raw, x, y);
  }
  if (const float black = *std::ranges::max_element(readings.black); black >= readings.white) {
    return Fail(ErrorCode::kBadData, "{}: its black level {} is not below its white level {}",
                path.string(), black, readings.white);
  }
  return readings;
}

// Returns the visible area as a fraction of the way from black to white.
RawMosaic FractionsOf(const RawReadings& readings) {
  RawMosaic mosaic{
      .samples = Image<float>(readings.size_px), .cfa = readings.cfa, .white = readings.white};
  for (const float black : readings.black) {
    mosaic.black += black / 4.0F;
  }
  for (int y = 0; y < readings.size_px.height; ++y) {
    const std::span<const uint16_t> row = readings.Row(y);
    float* const to = mosaic.samples.pixels.data() + mosaic.samples.Index(0, y);
    for (size_t x = 0; x < row.size(); ++x) {
      const float black = readings.black[static_cast<size_t>(y % 2) * 2 + x % 2];
      to[x] = (static_cast<float>(row[x]) - black) / (readings.white - black);
    }
  }
  return mosaic;
}

using TakeDecoded = std::function<Status(const RawReadings&, const libraw_data_t&)>;

// A file whose header is read and allowed.
struct OpenedRaw {
  InputFile file;               // as long as `raw` reads it
  std::unique_ptr<LibRaw> raw;  // too large for a stack

  [[nodiscard]] ImageSize Size() const {
    return {raw->imgdata.sizes.width, raw->imgdata.sizes.height};
  }
};

// Both the visible area and all sites are checked: room is made for all.
Status CheckLimit(const std::filesystem::path& path, const OpenedRaw& opened,
                  const PictureLimit& limit) {
  const libraw_image_sizes_t& sizes = opened.raw->imgdata.sizes;
  return limit.Check(path, opened.Size(), opened.file.Bytes()).and_then([&] {
    const PictureLimit of_sites{.max_pixels = limit.max_pixels};
    return of_sites.Check(path, {sizes.raw_width, sizes.raw_height}, opened.file.Bytes());
  });
}

void ThrowIfNoMemory(int libraw_status) {
  if (libraw_status == LIBRAW_UNSUFFICIENT_MEMORY) {
    throw std::bad_alloc();
  }
}

Result<OpenedRaw> OpenRaw(const std::filesystem::path& path, const PictureLimit& limit) {
  Result<InputFile> file = InputFile::Open(path);
  if (!file) {
    return tl::unexpected(file.error());
  }
  const Result<std::string> head = ReadHead(*file);
  if (!head) {
    return tl::unexpected(head.error());
  }
  if (IsTiffHead(*head)) {
    if (Status whole = CheckTiffIsWhole(*file); !whole) {
      return tl::unexpected(whole.error());
    }
  }
  OpenedRaw opened{*std::move(file), std::make_unique<LibRaw>(LIBRAW_OPTIONS_NONE)};
  opened.raw->set_dataerror_handler(nullptr, nullptr);  // it would print to stderr
  const int status = opened.raw->open_file(opened.file.LibraryName().c_str());
  ThrowIfNoMemory(status);
  if (status != LIBRAW_SUCCESS) {
    return tl::unexpected(CheckDecoded(path, *opened.raw, status).error());
  }
  if (Status allowed = CheckLimit(path, opened, limit); !allowed) {
    return tl::unexpected(allowed.error());
  }
  return opened;
}

Status Unpack(const std::filesystem::path& path, OpenedRaw& opened) {
  const int status = opened.raw->unpack();
  ThrowIfNoMemory(status);
  return CheckDecoded(path, *opened.raw, status);
}

// Calls `use` with the opened file, and turns what is thrown into errors.
Status WithOpened(const std::filesystem::path& path, const PictureLimit& limit,
                  const std::function<Status(OpenedRaw&)>& use) {
  ImageSize size_px;
  try {
    return OpenRaw(path, limit).and_then([&](OpenedRaw opened) {
      size_px = opened.Size();
      return use(opened);
    });
  } catch (const std::bad_alloc&) {
    return OutOfMemory(path, size_px, sizeof(uint16_t) * size_px.PixelCount());
  } catch (const std::exception& error) {
    return Fail(ErrorCode::kBadData, "{}: cannot be decoded as camera RAW: {}", path.string(),
                error.what());
  }
}

Status Decode(const std::filesystem::path& path, const PictureLimit& limit,
              const TakeDecoded& take) {
  return WithOpened(path, limit, [&](OpenedRaw& opened) {
    return Unpack(path, opened)
        .and_then([&] { return ReadingsOf(path, *opened.raw); })
        .and_then([&](const RawReadings& readings) { return take(readings, opened.raw->imgdata); });
  });
}

// The rows above, at and below a pixel, mirrored at the border; likewise its columns.
struct Neighbourhood {
  const float* above;
  const float* row;
  const float* below;
  size_t left;
  size_t x;
  size_t right;

  [[nodiscard]] float Horizontal() const { return (row[left] + row[right]) / 2.0F; }
  [[nodiscard]] float Vertical() const { return (above[x] + below[x]) / 2.0F; }
  [[nodiscard]] float Cross() const {
    return ((above[x] + below[x]) + (row[left] + row[right])) / 4.0F;
  }
  [[nodiscard]] float Corners() const {
    return ((above[left] + above[right]) + (below[left] + below[right])) / 4.0F;
  }
};

// Mirrors a place in a line of `count`: the one before the first is the second, the one after the
// last is the last but one.
size_t Mirrored(int i, int count) {
  return static_cast<size_t>(i < 0 ? 1 : i >= count ? count - 2 : i);
}

}  // namespace

bool IsRawName(const std::filesystem::path& path) {
  constexpr std::array<std::string_view, 24> kEndings = {
      ".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dcr", ".dng", ".erf",
      ".iiq", ".kdc", ".mef", ".mos", ".mrw", ".nef", ".nrw", ".orf",
      ".pef", ".raf", ".rw2", ".rwl", ".sr2", ".srf", ".srw", ".x3f"};
  std::string ending = path.extension().string();
  std::ranges::transform(ending, ending.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::ranges::find(kEndings, ending) != kEndings.end();
}

Result<RawMosaic> ReadRawMosaic(const std::filesystem::path& path, const PictureLimit& limit) {
  RawMosaic mosaic;
  return Decode(path, limit,
                [&](const RawReadings& readings, const libraw_data_t& data) {
                  mosaic = FractionsOf(readings);
                  FillMetadata(data, mosaic);
                  return Status();
                })
      .map([&] { return std::move(mosaic); });
}

Result<ImageSize> ReadRawSize(const std::filesystem::path& path, const PictureLimit& limit) {
  ImageSize size_px;
  return WithOpened(path, limit,
                    [&](const OpenedRaw& opened) {
                      size_px = opened.Size();
                      return Status();
                    })
      .map([&] { return size_px; });
}

Status TakeRawReadings(const std::filesystem::path& path,
                       const std::function<Status(const RawReadings&)>& take,
                       const PictureLimit& limit) {
  return Decode(path, limit, [&](const RawReadings& readings, const libraw_data_t& /*data*/) {
    return take(readings);
  });
}

Image3 Demosaic(const RawMosaic& mosaic, const std::array<float, 3>& white_balance) {
  const int width = mosaic.samples.width;
  const int height = mosaic.samples.height;
  SATEEN_CHECK(width >= 2 && height >= 2);
  Image3 rgb(mosaic.samples.Size());
  for (int y = 0; y < height; ++y) {
    const float* samples = mosaic.samples.pixels.data();
    const size_t stride = static_cast<size_t>(width);
    const size_t row = static_cast<size_t>(y) * stride;
    for (int x = 0; x < width; ++x) {
      const Neighbourhood near{samples + Mirrored(y - 1, height) * stride,
                               samples + row,
                               samples + Mirrored(y + 1, height) * stride,
                               Mirrored(x - 1, width),
                               static_cast<size_t>(x),
                               Mirrored(x + 1, width)};
      const size_t p = row + near.x;
      const size_t site = static_cast<size_t>((y % 2) * 2 + x % 2);
      const uint8_t own = mosaic.cfa[site];
      rgb[own].pixels[p] = samples[p];
      if (own == kGreen) {
        rgb[mosaic.cfa[site ^ 1]].pixels[p] = near.Horizontal();
        rgb[mosaic.cfa[site ^ 2]].pixels[p] = near.Vertical();
      } else {
        rgb[kGreen].pixels[p] = near.Cross();
        rgb[static_cast<size_t>(kBlue - own)].pixels[p] = near.Corners();
      }
    }
  }
  for (size_t c = 0; c < 3; ++c) {
    for (float& value : rgb[c].pixels) {
      value *= white_balance[c];
    }
  }
  return rgb;
}

}  // namespace sateen
