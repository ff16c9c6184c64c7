#include "scanner/sessions/sheet_frames.h"

#include <algorithm>
#include <array>

#include "core/parallel.h"
#include "imaging/image_io.h"
#include "imaging/raw.h"

namespace sateen {
namespace {

constexpr double kPaperShare =
    0.75;  // share of the sites of a colour that are darker: a bright place of paper

// Returns each colour times what makes the paper grey.
Image<float> BalancedMosaic(RawMosaic mosaic) {
  std::array<std::vector<float>, 3> of_colour;
  const auto colour_at = [&](int x, int y) {
    return mosaic.cfa[static_cast<size_t>(y % 2 * 2 + x % 2)];
  };
  Image<float>& samples = mosaic.samples;
  for (int y = 0; y < samples.height; ++y) {
    for (int x = 0; x < samples.width; ++x) {
      of_colour[colour_at(x, y)].push_back(samples.At(x, y));
    }
  }
  std::array<float, 3> gain = {1.0F, 1.0F, 1.0F};
  for (size_t c = 0; c < 3; ++c) {
    std::vector<float>& values = of_colour[c];
    const auto bright = values.begin() + static_cast<std::ptrdiff_t>(
                                             kPaperShare * static_cast<double>(values.size()));
    if (bright != values.end()) {
      std::nth_element(values.begin(), bright, values.end());
      gain[c] = *bright > 0.0F ? 1.0F / *bright : 1.0F;
    }
  }
  for (int y = 0; y < samples.height; ++y) {
    for (int x = 0; x < samples.width; ++x) {
      samples.At(x, y) *= gain[colour_at(x, y)] / gain[1];  // green stays
    }
  }
  return std::move(samples);
}

Image<float> GreyOf(const Photo& photo) {
  Image<float> grey(photo.rgb.Size());
  for (size_t i = 0; i < grey.pixels.size(); ++i) {
    grey.pixels[i] =
        (photo.rgb[0].pixels[i] + photo.rgb[1].pixels[i] + photo.rgb[2].pixels[i]) / 3.0F;
  }
  return grey;
}

Image<float> Joined(const Image<float>& full, int shrink, double exposure) {
  Image<float> small(full.width / shrink, full.height / shrink);
  const auto share = static_cast<float>(1.0 / (exposure * shrink * shrink));
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      float sum = 0.0F;
      for (int site = 0; site < shrink * shrink; ++site) {
        sum += full.At(x * shrink + site % shrink, y * shrink + site / shrink);
      }
      small.At(x, y) = share * sum;
    }
  }
  return small;
}

Result<Image<float>> ReadOne(const FrameFile& file, int shrink) {
  const auto joined = [&](const Image<float>& full) { return Joined(full, shrink, file.exposure); };
  if (IsRawName(file.path)) {
    return ReadRawMosaic(file.path, file.limit).map([&](RawMosaic mosaic) {
      return joined(BalancedMosaic(std::move(mosaic)));
    });
  }
  return ReadPhoto(file.path, Encoding::kAuto, file.limit).map([&](const Photo& photo) {
    return joined(GreyOf(photo));
  });
}

}  // namespace

Result<std::vector<Image<float>>> ReadSheetFrames(const std::vector<FrameFile>& lit, int shrink,
                                                  const Task& task) {
  std::vector<Result<Image<float>>> read(lit.size());
  const Status ran = ParallelFor(static_cast<int>(lit.size()), 1, task, [&](int begin, int end) {
    for (int k = begin; k < end; ++k) {
      read[static_cast<size_t>(k)] = ReadOne(lit[static_cast<size_t>(k)], shrink);
    }
  });
  if (!ran) {
    return tl::unexpected(ran.error());
  }
  std::vector<Image<float>> frames;
  frames.reserve(read.size());
  for (Result<Image<float>>& one : read) {
    if (!one) {
      return tl::unexpected(one.error());
    }
    frames.push_back(std::move(*one));
  }
  return frames;
}

}  // namespace sateen
