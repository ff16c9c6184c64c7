// Whatever part of a text file is missing, the answer is an error or a dataset that holds together.
#include "core/files/file_io.h"
#include "tests/scanner/sessions/dataset_files.h"

namespace sateen::truncation_test {
namespace {

namespace fs = std::filesystem;

using testing::TempFolder;
using testing::WriteText;

void ExpectWhole(const Dataset& dataset) {
  ASSERT_FALSE(dataset.stack.empty());
  ASSERT_EQ(dataset.stack.size(), dataset.rig.lights.size());
  for (const Light& light : dataset.rig.lights) {
    EXPECT_TRUE(light.Validate("light"));
  }
}

// Reads `dataset` with `text_file` cut at every byte, and with every byte replaced in turn.
void Spoil(const fs::path& dataset, const fs::path& text_file) {
  const std::string text = ReadFileBytes(text_file).value();
  int errors = 0;
  const auto read = [&](const std::string& spoiled) {
    WriteText(text_file, spoiled);
    const Result<Dataset> result = ReadDataset(dataset, {}, {.threads = 1});
    if (result) {
      ExpectWhole(*result);
    } else {
      EXPECT_FALSE(result.error().message.empty());
      ++errors;
    }
  };
  for (size_t length = 0; length < text.size(); ++length) {
    read(text.substr(0, length));
  }
  for (const char c : {'\0', '-', '\n', '9', '\xFF'}) {
    for (size_t i = 0; i < text.size(); ++i) {
      std::string spoiled = text;
      spoiled[i] = c;
      read(spoiled);
    }
  }
  EXPECT_GT(errors, 0);
  WriteText(text_file, text);
  const Result<Dataset> whole = ReadDataset(dataset, {});
  EXPECT_TRUE(whole) << whole.error().message;
}

TEST(Truncation, OfDiligentFiles) {
  const TempFolder temp;
  testing::WriteDiligent(temp.Path());
  for (const char* name : {"light_directions.txt", "light_intensities.txt", "filenames.txt"}) {
    Spoil(temp.Path(), temp.Path() / name);
  }
}

TEST(Truncation, OfLights) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  Spoil(temp.Path(), temp.Path() / "lights.txt");
  WriteText(temp.Path() / "lights.txt", "4\n0.6 -0.6 0 0\n0 0 0.6 -0.6\n0.8 0.8 0.8 0.8\n");
  Spoil(temp.Path(), temp.Path() / "lights.txt");
}

TEST(Truncation, OfLp) {
  const TempFolder temp;
  testing::WriteLightsFolder(temp.Path());
  WriteText(temp.Path() / "a.lp", "2\nC:\\x y\\im.8.exr 3 0 4\nim.9.exr 0 0.6 0.8\n");
  Spoil(temp.Path() / "a.lp", temp.Path() / "a.lp");
}

TEST(Truncation, OfSession) {
  const TempFolder temp;
  Session session = testing::FourLightSession();
  for (SessionFrame& frame : session.frames) {
    frame.exposure_s = 0.5;
  }
  session.table_from_sheet = Eigen::Isometry3d::Identity();
  testing::WriteSession(temp.Path() / "s", session);
  Spoil(temp.Path() / "s", temp.Path() / "s/session.json");
}

}  // namespace
}  // namespace sateen::truncation_test
