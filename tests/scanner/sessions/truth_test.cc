#include "scanner/sessions/truth.h"

#include <matio.h>

#include <limits>

#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::truth_test {
namespace {

namespace fs = std::filesystem;

using testing::IsError;
using testing::TempFolder;

constexpr size_t kWidth = 4;
constexpr size_t kHeight = 3;

template <typename T>
void WriteMat(const fs::path& path, const char* name, matio_classes type, matio_types data_type,
              std::vector<size_t> dims, std::vector<T> values,
              matio_compression compression = MAT_COMPRESSION_ZLIB) {
  mat_t* file = Mat_CreateVer(path.c_str(), nullptr, MAT_FT_MAT5);
  matvar_t* variable = Mat_VarCreate(name, type, data_type, static_cast<int>(dims.size()),
                                     dims.data(), values.data(), 0);
  ASSERT_EQ(Mat_VarWrite(file, variable, compression), 0);
  Mat_VarFree(variable);
  Mat_Close(file);
}

// Every element of the array differs in where it would land if rows and columns were mixed up:
// along x the normal tilts right, along y it tilts up.
std::vector<double> TiltedNormals() {
  std::vector<double> values(kHeight * kWidth * 3);
  for (size_t y = 0; y < kHeight; ++y) {
    for (size_t x = 0; x < kWidth; ++x) {
      const Eigen::Vector3d n =
          Eigen::Vector3d(0.1 * static_cast<double>(x), -0.2 * static_cast<double>(y), 1)
              .normalized();
      for (size_t c = 0; c < 3; ++c) {
        values[y + kHeight * (x + kWidth * c)] = n[static_cast<Eigen::Index>(c)];
      }
    }
  }
  return values;
}

class TruthFile : public ::testing::Test {
 protected:
  Result<Truth> Read(const char* name) {
    return ReadTruth({temp_.Path() / name, std::nullopt}, testing::kSize, hashes_);
  }
  Error FailureOf(const char* name) {
    const Result<Truth> truth = Read(name);
    EXPECT_FALSE(truth);
    return truth ? Error{} : truth.error();
  }

  TempFolder temp_;
  std::map<std::string, std::string> hashes_;
};

TEST_F(TruthFile, ReadsMatlabArraysColumnByColumn) {
  WriteMat(temp_.Path() / "Normal_gt.mat", "Normal_gt", MAT_C_DOUBLE, MAT_T_DOUBLE,
           {kHeight, kWidth, 3}, TiltedNormals());
  const Result<Truth> truth = Read("Normal_gt.mat");
  ASSERT_TRUE(truth) << truth.error().message;
  const Eigen::Vector3d n = Eigen::Vector3d(0.3, -0.4, 1).normalized();
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_FLOAT_EQ(truth->normal[c].At(3, 2), static_cast<float>(n[static_cast<Eigen::Index>(c)]));
  }
  EXPECT_TRUE(hashes_.contains((temp_.Path() / "Normal_gt.mat").string()));
}

TEST_F(TruthFile, RefusesMatlabFilesWithoutTheArray) {
  WriteMat(temp_.Path() / "other.mat", "N", MAT_C_DOUBLE, MAT_T_DOUBLE, {kHeight, kWidth, 3},
           TiltedNormals());
  EXPECT_THAT(FailureOf("other.mat"),
              IsError(ErrorCode::kBadData, "no readable variable Normal_gt"));
  WriteMat(temp_.Path() / "flat.mat", "Normal_gt", MAT_C_DOUBLE, MAT_T_DOUBLE,
           {kHeight, kWidth * 3}, TiltedNormals());
  EXPECT_THAT(FailureOf("flat.mat"), IsError(ErrorCode::kBadData, "not an array of H x W x 3"));
  WriteMat(temp_.Path() / "single.mat", "Normal_gt", MAT_C_SINGLE, MAT_T_SINGLE,
           {kHeight, kWidth, 3}, std::vector<float>(kHeight * kWidth * 3));
  EXPECT_THAT(FailureOf("single.mat"), IsError(ErrorCode::kBadData, "not an array of H x W x 3"));
  testing::WriteText(temp_.Path() / "text.mat", "no MATLAB file");
  EXPECT_THAT(FailureOf("text.mat"), IsError(ErrorCode::kBadData, "MATLAB"));
}

TEST_F(TruthFile, RefusesMatlabFilesCutShort) {
  const fs::path path = temp_.Path() / "Normal_gt.mat";
  for (const matio_compression compression : {MAT_COMPRESSION_ZLIB, MAT_COMPRESSION_NONE}) {
    WriteMat(path, "Normal_gt", MAT_C_DOUBLE, MAT_T_DOUBLE, {kHeight, kWidth, 3}, TiltedNormals(),
             compression);
    EXPECT_TRUE(Read("Normal_gt.mat"));
    for (auto size = fs::file_size(path); size > 0; --size) {
      testing::CutShort(path, size - 1);
      EXPECT_EQ(FailureOf("Normal_gt.mat").code, ErrorCode::kBadData) << size - 1 << " bytes";
    }
  }
}

TEST_F(TruthFile, RefusesNormalsThatAreNeitherUnitNorZero) {
  Image3 normal = testing::LevelNormals();
  normal[2].At(2, 1) = 0.5F;  // as in a picture of normals, (n + 1) / 2
  ASSERT_TRUE(WriteExr(temp_.Path() / "n.exr", normal));
  EXPECT_THAT(FailureOf("n.exr"),
              IsError(ErrorCode::kBadData, "at column 2, row 1 has length 0.5; need 1, or 0"));
  normal[2].At(2, 1) = std::numeric_limits<float>::quiet_NaN();
  ASSERT_TRUE(WriteExr(temp_.Path() / "n.exr", normal));
  EXPECT_THAT(FailureOf("n.exr"), IsError(ErrorCode::kBadData, "has length nan"));
}

TEST_F(TruthFile, RefusesAnotherSize) {
  ASSERT_TRUE(WriteExr(temp_.Path() / "n.exr", testing::LevelNormals({4, 4})));
  EXPECT_THAT(FailureOf("n.exr"), IsError(ErrorCode::kBadData, "n.exr: is 4 x 4 px"));
}

TEST_F(TruthFile, RefusesAMatlabArrayOfAnotherSize) {
  WriteMat(temp_.Path() / "n.mat", "Normal_gt", MAT_C_DOUBLE, MAT_T_DOUBLE, {kWidth, kHeight, 3},
           TiltedNormals());
  EXPECT_THAT(FailureOf("n.mat"),
              IsError(ErrorCode::kBadData,
                      "n.mat: is 3 x 4 px, but the first frame is 4 x 3 px; need one size"));
}

TEST_F(TruthFile, IsFoundByItsName) {
  EXPECT_FALSE(FindPublicTruth(temp_.Path()));
  EXPECT_FALSE(FindSessionTruth(temp_.Path()));
  testing::WriteText(temp_.Path() / "Normal_gt.mat", "");
  EXPECT_EQ(FindPublicTruth(temp_.Path())->normal.filename(), "Normal_gt.mat");
  testing::WriteText(temp_.Path() / "normal_gt.exr", "");
  EXPECT_EQ(FindPublicTruth(temp_.Path())->normal.filename(), "normal_gt.exr");
  testing::WriteText(temp_.Path() / "truth/normal.exr", "");
  EXPECT_FALSE(FindSessionTruth(temp_.Path())->albedo);
  testing::WriteText(temp_.Path() / "truth/albedo.exr", "");
  EXPECT_TRUE(FindSessionTruth(temp_.Path())->albedo);
}

}  // namespace
}  // namespace sateen::truth_test
