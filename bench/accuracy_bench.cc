// Speed and error of the ladder beside plain re-implementations of others' estimators, on every data
// set that is there: whole-image least squares by bdcSvd (every sample), and per pixel, in dynamic
// double matrices, Huber and L1 by reweighting and sparse Bayesian regression. One thread; the
// estimators per pixel see the same usable samples.
//
//   accuracy_bench [DATA_FOLDER]      otherwise $SATEEN_DATA or ../shared/data

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <functional>

#include "scanner/stack_reader.h"
#include "solver/evaluate.h"
#include "solver/ladder.h"
#include "solver/pixel_system.h"

namespace sateen {
namespace {

using Estimator =
    std::function<Eigen::Vector3d(const Eigen::MatrixX3d& l, const Eigen::VectorXd& i)>;

constexpr int kSteps = 30;

// Weighted least squares again and again, by LDLT; `weight` of the absolute residual.
Estimator Reweighted(std::function<double(double residual, double scale)> weight) {
  return [weight = std::move(weight)](const Eigen::MatrixX3d& l, const Eigen::VectorXd& i) {
    Eigen::MatrixXd normal_matrix = l.transpose() * l;
    Eigen::VectorXd n = normal_matrix.ldlt().solve(l.transpose() * i);
    for (int step = 0; step < kSteps; ++step) {
      const Eigen::VectorXd r = (i - l * n).cwiseAbs();
      const Eigen::VectorXd w =
          r.unaryExpr([&](double residual) { return weight(residual, i.maxCoeff()); });
      normal_matrix = l.transpose() * w.asDiagonal() * l;
      n = normal_matrix.ldlt().solve(l.transpose() * w.asDiagonal() * i);
    }
    return Eigen::Vector3d(n);
  };
}

// Ikehata, Wipf, Matsushita and Aizawa, "Robust photometric stereo using sparse regression", 2012,
// equations 9 to 12: i = l n + e + noise, with a variance for each entry of e by expectation
// maximisation.
Eigen::Vector3d SparseBayesian(const Eigen::MatrixX3d& l, const Eigen::VectorXd& samples) {
  const Eigen::Index count = l.rows();
  const double scale = samples.mean();
  const Eigen::VectorXd i = samples / scale;
  constexpr double kNoise = 1e-6;
  constexpr double kDiffuseVariance = 1e6;
  Eigen::VectorXd gamma = Eigen::VectorXd::Ones(count);
  Eigen::VectorXd e = Eigen::VectorXd::Zero(count);
  for (int step = 0; step < 100; ++step) {
    Eigen::MatrixXd sigma = kDiffuseVariance * l * l.transpose();
    sigma.diagonal() += gamma + Eigen::VectorXd::Constant(count, kNoise);
    const Eigen::MatrixXd inverse = sigma.inverse();
    e = gamma.cwiseProduct(inverse * i);
    const Eigen::VectorXd variance =
        gamma - gamma.cwiseProduct(inverse.diagonal()).cwiseProduct(gamma);
    gamma = (e.cwiseAbs2() + variance).cwiseMax(1e-12);
  }
  return scale * l.colPivHouseholderQr().solve(i - e);
}

struct DataSet {
  std::string name;
  std::filesystem::path folder;
  std::vector<int> lights;
  bool exposed = false;  // the 95th percentile at 0.8 of full scale, clipped
};

struct Row {
  std::string method;
  ErrorStatistics error;
  double ns_per_pixel = 0.0;
};

double ProcessorSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

bool Inside(const Capture& capture, size_t pixel) {
  return !capture.mask || capture.mask->pixels[pixel] != 0;
}

void Expose(Capture& capture) {
  std::vector<float> samples;
  for (const LightFrame& frame : capture.stack) {
    for (size_t p = 0; p < frame.rgb[1].pixels.size(); ++p) {
      if (Inside(capture, p)) {
        samples.push_back(frame.rgb[1].pixels[p]);
      }
    }
  }
  const auto place = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() * 95 / 100);
  std::nth_element(samples.begin(), place, samples.end());
  for (LightFrame& frame : capture.stack) {
    frame.full_scale = 1.0F;
    for (Image<float>& plane : frame.rgb.planes) {
      for (float& value : plane.pixels) {
        value = std::min(1.0F, 0.8F / *place * value);
      }
    }
  }
}

void StoreNormal(const Eigen::Vector3d& n, size_t pixel, NormalField& field) {
  const bool answered = n.allFinite() && !n.isZero();
  field.reason.pixels[pixel] =
      static_cast<uint8_t>(answered ? Reason::kSolved : Reason::kIllConditioned);
  for (size_t c = 0; c < 3; ++c) {
    field.normal[c].pixels[pixel] =
        answered ? static_cast<float>(n.normalized()[static_cast<Eigen::Index>(c)]) : 0.0F;
  }
}

Row Finished(std::string method, const Capture& capture, const NormalField& field, double seconds) {
  const ErrorStatistics error = AngularErrorDeg(field, capture.truth->normal).value();
  size_t pixels = 0;
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    pixels += Inside(capture, p) ? 1 : 0;
  }
  return {std::move(method), error, seconds * 1e9 / static_cast<double>(pixels)};
}

Row PerPixel(std::string method, const Capture& capture, const Estimator& estimate) {
  NormalField field;
  field.Resize(capture.stack[0].rgb.Size());
  const LambertianOptions options;
  PixelSystem system(capture.stack, capture.rig, options);
  const double start = ProcessorSeconds();
  for (int y = 0; y < field.reason.height; ++y) {
    for (int x = 0; x < field.reason.width; ++x) {
      const size_t pixel = field.reason.Index(x, y);
      if (!Inside(capture, pixel)) {
        continue;
      }
      system.Gather(x, y);
      if (system.SampleReason() == Reason::kSolved) {
        StoreNormal(estimate(system.L(), system.Rhs().col(3)), pixel, field);
      }
    }
  }
  return Finished(std::move(method), capture, field, ProcessorSeconds() - start);
}

// Distant lights alone; takes every sample for usable.
Row WholeImage(const Capture& capture) {
  NormalField field;
  field.Resize(capture.stack[0].rgb.Size());
  const auto lights = static_cast<Eigen::Index>(capture.stack.size());
  std::vector<size_t> pixels;
  for (size_t p = 0; p < field.reason.pixels.size(); ++p) {
    if (Inside(capture, p)) {
      pixels.push_back(p);
    }
  }
  const double start = ProcessorSeconds();
  Eigen::MatrixXd l(lights, 3);
  Eigen::MatrixXd i(lights, static_cast<Eigen::Index>(pixels.size()));
  for (Eigen::Index k = 0; k < lights; ++k) {
    const Light& light = capture.rig.lights[static_cast<size_t>(k)];
    const Image3& rgb = capture.stack[static_cast<size_t>(k)].rgb;
    l.row(k) = light.direction.transpose();
    for (size_t j = 0; j < pixels.size(); ++j) {
      const Eigen::Vector3d sample(rgb[0].pixels[pixels[j]], rgb[1].pixels[pixels[j]],
                                   rgb[2].pixels[pixels[j]]);
      i(k, static_cast<Eigen::Index>(j)) =
          sample.cwiseQuotient(light.flux_rgb).dot(Eigen::Vector3d(0.2126, 0.7152, 0.0722));
    }
  }
  const Eigen::MatrixXd n = l.bdcSvd(Eigen::ComputeThinU | Eigen::ComputeThinV).solve(i);
  for (size_t j = 0; j < pixels.size(); ++j) {
    StoreNormal(n.col(static_cast<Eigen::Index>(j)), pixels[j], field);
  }
  return Finished("bdcSvd, all samples", capture, field, ProcessorSeconds() - start);
}

Row Ladder(const Capture& capture) {
  NormalField field;
  LadderOptions options;
  options.noise = NoiseOf(capture.stack, capture.rig);
  const double start = ProcessorSeconds();
  if (Status status =
          SolveLadderInto(capture.stack, capture.rig, capture.mask, options, {.threads = 1}, field);
      !status) {
    fmt::print("ladder: {}\n", status.error().message);
  }
  return Finished("ladder", capture, field, ProcessorSeconds() - start);
}

void RunDataSet(const DataSet& set) {
  Result<Capture> capture = ReadCapture(set.folder, {.lights = set.lights}, {});
  if (!capture || !capture->truth) {
    fmt::print("{}: skipped, {}\n", set.name, capture ? "no truth in it" : capture.error().message);
    return;
  }
  if (set.exposed) {
    Expose(*capture);
  }
  std::vector<Row> rows = {WholeImage(*capture)};
  rows.push_back(
      PerPixel("least squares, usable", *capture, Reweighted([](double, double) { return 1.0; })));
  rows.push_back(PerPixel("Huber", *capture, Reweighted([](double r, double scale) {
                            return std::min(1.0, 0.01 * scale / std::max(r, 1e-12));
                          })));
  rows.push_back(PerPixel("L1", *capture, Reweighted([](double r, double scale) {
                            return 1.0 / std::max(r, 1e-6 * scale);
                          })));
  if (capture->stack.size() <= 20) {
    rows.push_back(PerPixel("sparse Bayesian", *capture, SparseBayesian));
  }
  rows.push_back(Ladder(*capture));
  for (const Row& row : rows) {
    fmt::print("| {} | {} | {:.3f} | {:.3f} | {} | {:.0f} |\n", set.name, row.method,
               row.error.mean, row.error.median, row.error.count, row.ns_per_pixel);
  }
}

int Main(int argc, char** argv) {
  const char* from_environment = std::getenv("SATEEN_DATA");
  const std::filesystem::path data = argc > 1           ? argv[1]
                                     : from_environment ? from_environment
                                                        : "../shared/data";
  const std::vector<int> ten = {2, 3, 4, 18, 20, 23, 24, 26, 34, 36};
  const std::vector<int> every_tenth = {0, 10, 20, 30, 40, 50, 60, 70, 80, 90};
  fmt::print("| data | method | mean deg | median deg | solved | ns/px, one thread |\n");
  fmt::print("| --- | --- | --- | --- | --- | --- |\n");
  for (const DataSet& set : {DataSet{"shiny bunny 10, clipped", data / "bunny/specular", ten, true},
                             DataSet{"shiny bunny 10", data / "bunny/specular", ten},
                             DataSet{"matte bunny 10", data / "bunny/lambert", ten},
                             DataSet{"ball 10", data / "diligent-ball", every_tenth},
                             DataSet{"ball 96", data / "diligent-ball", {}}}) {
    RunDataSet(set);
  }
  return 0;
}

}  // namespace
}  // namespace sateen

int main(int argc, char** argv) { return sateen::Main(argc, argv); }
