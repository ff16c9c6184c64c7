#include "pipelines/solve/maps.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <string>
#include <utility>
#include <vector>

#include "imaging/image_io.h"
#include "imaging/show/canvas.h"
#include "imaging/show/pictures.h"

namespace sateen {
namespace {

constexpr double kHeatPercentile = 0.99;

// Returns the 99th percentile over the known pixels, which becomes white.
float TopOf(const Image<float>& values, const Image<uint8_t>& known) {
  std::vector<float> counted;
  for (size_t p = 0; p < values.pixels.size(); ++p) {
    if (known.pixels[p] != 0) {
      counted.push_back(values.pixels[p]);
    }
  }
  if (counted.empty()) {
    return 1.0F;
  }
  const auto place =
      counted.begin() +
      static_cast<std::ptrdiff_t>(kHeatPercentile * static_cast<double>(counted.size() - 1));
  std::nth_element(counted.begin(), place, counted.end());
  return *place;
}

Image3 WithYDown(const Image3& normal) {
  Image3 flipped = normal;
  for (float& y : flipped[1].pixels) {
    y = -y;
  }
  return flipped;
}

Image<uint8_t> SolvedOf(const NormalField& band) {
  Image<uint8_t> solved(band.reason.Size());
  std::ranges::transform(band.reason.pixels, solved.pixels.begin(), [](uint8_t reason) {
    return reason == static_cast<uint8_t>(Reason::kSolved) ? uint8_t{1} : uint8_t{0};
  });
  return solved;
}

template <typename T>
std::span<const Image<T>> One(const Image<T>& image) {
  return {&image, 1};
}

}  // namespace

MapsWriter::MapsWriter(ImageSize size_px, NormalY normal_y)
    : normal_y_(normal_y),
      small_normal_(size_px, kOverviewPanelWidthPx, 3),
      small_albedo_(size_px, kOverviewPanelWidthPx, 3),
      small_quality_(size_px, kOverviewPanelWidthPx, 1) {}

Result<MapsWriter> MapsWriter::Begin(ImageSize size_px, const MapsFacts& facts, bool has_error,
                                     OutputFolder& folder) {
  MapsWriter writer(size_px, facts.normal_y);
  Status status;
  const auto open = [&]<typename T>(T /*kind*/, const char* name, size_t channels, bool is_wanted,
                                    std::optional<BandWriter>& file,
                                    std::optional<double> pixel_mm = std::nullopt) {
    if (!is_wanted) {
      folder.Retire(name);
    } else if (status) {
      Result<BandWriter> opened =
          BandWriter::Open<T>(folder.Stage(name), size_px, channels, pixel_mm);
      status = opened ? Status() : tl::unexpected(opened.error());
      if (opened) {
        file.emplace(*std::move(opened));
      }
    }
  };
  open(float(), "normal.exr", 3, true, writer.normal_);
  open(uint16_t(), "normal.png", 3, true, writer.normal_png_, facts.pixel_mm);
  open(float(), "albedo.exr", 3, true, writer.albedo_);
  open(float(), "residual.exr", 1, true, writer.residual_);
  open(uint8_t(), "samples.png", 1, true, writer.samples_);
  open(uint8_t(), "reason.png", 1, true, writer.reason_);
  open(float(), "uncertainty.exr", 1, facts.has_ladder, writer.uncertainty_);
  open(float(), "albedo_uncertainty.exr", 1, facts.has_ladder, writer.albedo_uncertainty_);
  open(uint8_t(), "model.png", 1, facts.has_ladder, writer.model_);
  open(float(), "error.exr", 1, has_error, writer.error_);
  return status ? Result<MapsWriter>(std::move(writer)) : tl::unexpected(status.error());
}

Status MapsWriter::Add(const NormalField& band, const Image<float>* angular_error_deg) {
  const bool is_down = normal_y_ == NormalY::kDown;
  const Image3 flipped = is_down ? WithYDown(band.normal) : Image3();
  const Image3& normal = is_down ? flipped : band.normal;
  // Deflating the one picture that is not mostly zeros takes as long as all the others together.
  std::future<Status> as_png =
      std::async(std::launch::async, [&] { return normal_png_->Write(EncodeNormal16(normal)); });
  Status status = normal_->Write(normal.planes)
                      .and_then([&] { return albedo_->Write(band.albedo.planes); })
                      .and_then([&] { return residual_->Write(One(band.residual)); })
                      .and_then([&] { return samples_->Write(One(band.samples)); })
                      .and_then([&] { return reason_->Write(One(band.reason)); });
  if (status && uncertainty_) {
    status = uncertainty_->Write(One(band.uncertainty))
                 .and_then([&] { return albedo_uncertainty_->Write(One(band.albedo_uncertainty)); })
                 .and_then([&] { return model_->Write(One(band.model)); });
  }
  if (status && error_) {
    status = error_->Write(One(*angular_error_deg));
  }
  const Image<uint8_t> solved = SolvedOf(band);
  small_normal_.Add(next_row_, normal.planes, &solved);
  small_albedo_.Add(next_row_, band.albedo.planes, &solved);
  small_quality_.Add(next_row_, One(error_ ? *angular_error_deg : band.residual), &solved);
  next_row_ += band.reason.height;
  const Status png = as_png.get();
  return status ? png : status;
}

Status MapsWriter::Finish(const Image3& first_frame, OutputFolder& folder) {
  Status status;
  for (std::optional<BandWriter>* file :
       {&normal_, &normal_png_, &albedo_, &residual_, &samples_, &reason_, &uncertainty_,
        &albedo_uncertainty_, &model_, &error_}) {
    if (status && *file) {
      status = (*file)->Close();
    }
  }
  const Image<uint8_t> known = small_quality_.Known();
  const Image<float> quality = small_quality_.Mean(0);
  const float top = TopOf(quality, known);
  const std::string heat =
      error_ ? HeatCaption("error", top, "deg") : HeatCaption("residual", top, "");
  std::vector<Rgb8> panels;
  for (const auto& [panel, caption] :
       {std::pair{ShowLinear(first_frame), std::string("first frame")},
        std::pair{ShowNormal(small_normal_.Means()), std::string("normal")},
        std::pair{ShowLinear(small_albedo_.Means()), std::string("albedo")},
        std::pair{ShowHeat(quality, top, known), heat}}) {
    panels.push_back(Captioned(panel, caption));
  }
  return status.and_then([&] {
    return WritePng8(folder.Stage("overview.png"),
                     ContactSheet(panels, static_cast<int>(panels.size())));
  });
}

Status StageMaps(const NormalField& field, const LightFrame& first_frame,
                 const std::optional<Image<float>>& angular_error_deg, const MapsFacts& facts,
                 OutputFolder& folder) {
  Thumbnail frame(first_frame.rgb.Size(), kOverviewPanelWidthPx, 3);
  frame.Add(0, first_frame.rgb.planes, nullptr);
  return MapsWriter::Begin(field.reason.Size(), facts, angular_error_deg.has_value(), folder)
      .and_then([&](MapsWriter writer) {
        return writer.Add(field, angular_error_deg ? &*angular_error_deg : nullptr).and_then([&] {
          return writer.Finish(frame.Means(), folder);
        });
      });
}

}  // namespace sateen
