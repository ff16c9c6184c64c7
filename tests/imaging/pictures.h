#pragma once

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "imaging/image.h"

// Pictures that the tests of reading and writing share.
namespace sateen::testing {

// A picture that no coder packs to nothing, different in every channel.
inline float Sample(int x, int y, int channel) {
  return 0.5F + 0.45F * std::sin(0.13F * static_cast<float>(x * (channel + 1)) +
                                 0.21F * static_cast<float>(y) * static_cast<float>(x % 7));
}

struct FileKind {
  const char* name;
  OIIO::TypeDesc type;
  int channels = 3;
  const char* compression = nullptr;
  int tile_px = 0;
};

// Writes with OpenImageIO itself, for the kinds of file that our own writers do not make.
inline void WriteWithOiio(const std::filesystem::path& path, OIIO::ImageSpec spec,
                          const std::vector<float>& samples) {
  const auto output = OIIO::ImageOutput::create(path.string());
  ASSERT_TRUE(output) << OIIO::geterror();
  ASSERT_TRUE(output->open(path.string(), spec)) << output->geterror();
  ASSERT_TRUE(output->write_image(OIIO::TypeFloat, samples.data())) << output->geterror();
  ASSERT_TRUE(output->close()) << output->geterror();
}

inline void WriteKind(const std::filesystem::path& path, const FileKind& kind) {
  OIIO::ImageSpec spec(97, 61, kind.channels, kind.type);
  spec.tile_width = spec.tile_height = kind.tile_px;
  if (kind.compression != nullptr) {
    spec.attribute("compression", kind.compression);
  }
  std::vector<float> samples;
  for (int y = 0; y < spec.height; ++y) {
    for (int x = 0; x < spec.width; ++x) {
      for (int c = 0; c < kind.channels; ++c) {
        samples.push_back(Sample(x, y, c));
      }
    }
  }
  WriteWithOiio(path, spec, samples);
}

inline std::string ReadBytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline bool SameBits(const Image3& a, const Image3& b) {
  return a.Size() == b.Size() && a[0].pixels == b[0].pixels && a[1].pixels == b[1].pixels &&
         a[2].pixels == b[2].pixels;
}

inline Image3 TestImage() {
  Image3 image(ImageSize{23, 17});
  for (size_t c = 0; c < 3; ++c) {
    for (int y = 0; y < 17; ++y) {
      for (int x = 0; x < 23; ++x) {
        image[c].At(x, y) = Sample(x, y, static_cast<int>(c)) * 2.0F - 1.0F;
      }
    }
  }
  return image;
}

}  // namespace sateen::testing
