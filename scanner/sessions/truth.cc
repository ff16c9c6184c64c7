#include "scanner/sessions/truth.h"

#include <matio.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <new>
#include <string_view>

#include "core/files/input_file.h"
#include "core/sha256.h"
#include "imaging/image_io.h"
#include "scanner/sessions/files/folder_listing.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

// Files hold half floats or four digits; a map in another encoding is off by far more.
constexpr double kUnitTolerance = 1e-2;
constexpr const char* kVariable = "Normal_gt";

using MatFile = std::unique_ptr<mat_t, decltype(&Mat_Close)>;
using MatVariable = std::unique_ptr<matvar_t, decltype(&Mat_VarFree)>;

// H x W x 3 doubles, column by column: element (y, x, c) stands at y + H (x + W c).
Image3 FromColumnMajor(const double* values, size_t height, size_t width) {
  Image3 image(ImageSize{static_cast<int>(width), static_cast<int>(height)});
  for (size_t c = 0; c < 3; ++c) {
    for (size_t y = 0; y < height; ++y) {
      for (size_t x = 0; x < width; ++x) {
        image[c].pixels[y * width + x] = static_cast<float>(values[y + height * (x + width * c)]);
      }
    }
  }
  return image;
}

uint32_t LittleEndian32(std::string_view bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 4; i-- > 0;) {
    value = value << 8U | static_cast<uint8_t>(bytes[at + i]);
  }
  return value;
}

// Fails unless the file is whole: matio gives zeros for what is missing at the end of a file. A
// MATLAB 5 file is 128 bytes, the last two "IM", then elements of 8 bytes (type, length) and
// `length` bytes each, to its end.
Status CheckMatWhole(const InputFile& file) {
  constexpr int kMaxElements = 1000;  // one for each variable
  std::string magic(128, '\0');
  Result<size_t> count = file.ReadAt(0, magic);
  if (!count) {
    return tl::unexpected(count.error());
  }
  if (!magic.starts_with("MATLAB 5.0") || !magic.ends_with("IM")) {
    return Fail(ErrorCode::kBadData,
                "{}: is not a little-endian MATLAB 5 file; need one, as `save -v7` writes it",
                file.Path().string());
  }
  uint64_t end = magic.size();
  for (int element = 0; end + 8 <= file.Bytes() && element < kMaxElements; ++element) {
    std::string head(8, '\0');
    count = file.ReadAt(end, head);
    if (!count) {
      return tl::unexpected(count.error());
    }
    end += 8 + uint64_t{LittleEndian32(head, 4)};
  }
  if (end != file.Bytes() || end == magic.size()) {
    return Fail(ErrorCode::kBadData, "{}: the MATLAB file is cut short at {} bytes; copy it again",
                file.Path().string(), file.Bytes());
  }
  return {};
}

// Reads the variable's header, then its values if the header fits.
Result<Image3> ReadMatVariable(const fs::path& path, mat_t* file, ImageSize size_px) {
  const MatVariable variable(Mat_VarReadInfo(file, kVariable), Mat_VarFree);
  if (variable == nullptr) {
    return Fail(ErrorCode::kBadData, "{}: has no readable variable {}, which holds the normals",
                path.string(), kVariable);
  }
  const bool is_field = variable->rank == 3 && variable->dims[2] == 3;
  const bool is_double = variable->class_type == MAT_C_DOUBLE && variable->isComplex == 0;
  if (!is_field || !is_double) {
    return Fail(ErrorCode::kBadData, "{}: {} is not an array of H x W x 3 real doubles",
                path.string(), kVariable);
  }
  const size_t height = variable->dims[0];
  const size_t width = variable->dims[1];
  constexpr size_t kMostSide = 1 << 30;
  const ImageSize size{static_cast<int>(std::min(width, kMostSide)),
                       static_cast<int>(std::min(height, kMostSide))};
  if (const Status same = CheckSize(path.string(), size, size_px); !same) {
    return tl::unexpected(same.error());
  }
  // matio tells a lack of memory and a damaged array alike.
  const size_t bytes = height * width * 3 * sizeof(double);
  if (std::unique_ptr<char[]>(new (std::nothrow) char[bytes]) == nullptr) {
    return OutOfMemory(path, size, bytes);
  }
  if (Mat_VarReadDataAll(file, variable.get()) != 0 || variable->data == nullptr ||
      variable->data_type != MAT_T_DOUBLE || variable->nbytes != bytes) {
    return Fail(ErrorCode::kBadData, "{}: {} is not an array of H x W x 3 real doubles",
                path.string(), kVariable);
  }
  return FromColumnMajor(static_cast<const double*>(variable->data), height, width);
}

Result<Image3> ReadMatNormals(const fs::path& path, ImageSize size_px) {
  const Result<InputFile> input = InputFile::Open(path);
  if (!input) {
    return tl::unexpected(input.error());
  }
  if (const Status status = CheckMatWhole(*input); !status) {
    return tl::unexpected(status.error());
  }
  const MatFile file(Mat_Open(input->LibraryName().c_str(), MAT_ACC_RDONLY), Mat_Close);
  if (file == nullptr) {
    return Fail(ErrorCode::kBadData, "{}: cannot be read as a MATLAB file", path.string());
  }
  return ReadMatVariable(path, file.get(), size_px);
}

Status CheckNormals(const Image3& normal, const fs::path& path) {
  for (int y = 0; y < normal.Size().height; ++y) {
    for (int x = 0; x < normal.Size().width; ++x) {
      // Not std::hypot: with three arguments, libstdc++'s can make 0 of a NaN.
      const double length =
          Eigen::Vector3f(normal[0].At(x, y), normal[1].At(x, y), normal[2].At(x, y))
              .cast<double>()
              .norm();
      if (length != 0.0 && !(std::abs(length - 1.0) <= kUnitTolerance)) {
        return Fail(ErrorCode::kBadData,
                    "{}: the normal at column {}, row {} has length {:.6g}; need 1, or 0 where it "
                    "is unknown",
                    path.string(), x, y, length);
      }
    }
  }
  return {};
}

Result<Image3> ReadPlanes(const fs::path& path, ImageSize size_px,
                          std::map<std::string, std::string>& sha256_of_input) {
  Result<std::string> hash = Sha256OfFile(path);
  if (!hash) {
    return tl::unexpected(hash.error());
  }
  sha256_of_input[path.string()] = *std::move(hash);
  const bool is_mat = LowerCase(path.extension().string()) == ".mat";
  return is_mat ? ReadMatNormals(path, size_px) : ReadImage3(path, {.size_px = size_px});
}

}  // namespace

std::optional<TruthFiles> FindPublicTruth(const fs::path& dir) {
  for (const char* name : {"normal_gt.exr", "Normal_gt.mat"}) {
    if (Exists(dir / name)) {
      return TruthFiles{dir / name, std::nullopt};
    }
  }
  return std::nullopt;
}

std::optional<TruthFiles> FindSessionTruth(const fs::path& dir) {
  const fs::path truth_dir = dir / "truth";
  if (!Exists(truth_dir / "normal.exr")) {
    return std::nullopt;
  }
  TruthFiles files{truth_dir / "normal.exr", std::nullopt};
  if (Exists(truth_dir / "albedo.exr")) {
    files.albedo = truth_dir / "albedo.exr";
  }
  return files;
}

Result<Truth> ReadTruth(const TruthFiles& files, ImageSize size_px,
                        std::map<std::string, std::string>& sha256_of_input) {
  Result<Image3> normal = ReadPlanes(files.normal, size_px, sha256_of_input);
  if (!normal) {
    return tl::unexpected(normal.error());
  }
  if (const Status status = CheckNormals(*normal, files.normal); !status) {
    return tl::unexpected(status.error());
  }
  Truth truth{*std::move(normal), std::nullopt, files.normal.string()};
  if (files.albedo) {
    Result<Image3> albedo = ReadPlanes(*files.albedo, size_px, sha256_of_input);
    if (!albedo) {
      return tl::unexpected(albedo.error());
    }
    truth.albedo = *std::move(albedo);
  }
  return truth;
}

}  // namespace sateen
