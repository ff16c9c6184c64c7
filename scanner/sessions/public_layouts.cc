#include "scanner/sessions/public_layouts.h"

#include "imaging/image_io.h"
#include "imaging/raw.h"
#include "scanner/sessions/files/folder_listing.h"
#include "scanner/sessions/files/light_table.h"
#include "scanner/sessions/files/text_table.h"

namespace sateen {
namespace {

namespace fs = std::filesystem;

struct DiligentTables {
  std::vector<NumberRow> directions;
  std::vector<NumberRow> intensities;
  std::vector<TextLine> names;
};

Result<DiligentTables> ReadDiligentTables(const fs::path& dir, ReadPlan& plan) {
  Result<std::vector<NumberRow>> directions =
      ReadNumberRows(dir / "light_directions.txt", plan.sha256_of_input);
  if (!directions) {
    return tl::unexpected(directions.error());
  }
  Result<std::vector<NumberRow>> intensities =
      ReadNumberRows(dir / "light_intensities.txt", plan.sha256_of_input);
  if (!intensities) {
    return tl::unexpected(intensities.error());
  }
  Result<std::vector<TextLine>> names = ReadTextLines(dir / "filenames.txt", plan.sha256_of_input);
  if (!names) {
    return tl::unexpected(names.error());
  }
  return DiligentTables{*std::move(directions), *std::move(intensities), *std::move(names)};
}

Status CheckDiligentTables(const DiligentTables& tables, const fs::path& dir) {
  const size_t count = tables.directions.size();
  if (count == 0 || tables.intensities.size() != count || tables.names.size() != count) {
    return Fail(ErrorCode::kBadData,
                "{}: found {} lines in light_directions.txt, {} in light_intensities.txt and {} "
                "in filenames.txt; need one in each for every light",
                dir.string(), count, tables.intensities.size(), tables.names.size());
  }
  return CheckWidths(tables.directions, 3, "3, a direction").and_then([&] {
    return CheckWidths(tables.intensities, 3, "3, an RGB intensity");
  });
}

// Returns the photographs of a folder. Cameras write RAW and JPEG side by side: RAW files count
// where there is nothing else, and are otherwise left out with a warning.
std::vector<std::string> SelectImages(const std::vector<std::string>& names, ReadPlan& plan) {
  std::vector<std::string> images;
  std::vector<std::string> raws;
  for (const std::string& name : names) {
    const bool is_truth = LowerCase(name).starts_with("normal_gt");
    if (IsPhotoName(name) && !is_truth && !IsMaskName(name)) {
      images.push_back(name);
    } else if (IsRawName(name)) {
      raws.push_back(name);
    }
  }
  if (images.empty()) {
    return raws;
  }
  if (!raws.empty()) {
    plan.warnings.push_back(
        fmt::format("{} camera RAW files were left out, the first is {}: the folder also has other "
                    "images; move those away to use the RAW files",
                    raws.size(), raws.front()));
  }
  return images;
}

}  // namespace

fs::path ParentOf(const fs::path& dir) { return (dir / "..").lexically_normal(); }

Result<ReadPlan> PlanDiligent(const fs::path& dir) {
  ReadPlan plan;
  plan.layout = "diligent";
  const Result<DiligentTables> tables = ReadDiligentTables(dir, plan);
  if (!tables) {
    return tl::unexpected(tables.error());
  }
  if (const Status status = CheckDiligentTables(*tables, dir); !status) {
    return tl::unexpected(status.error());
  }
  Result<Lights> lights = LightsFromRows(tables->directions, kUnitLengths);
  if (!lights) {
    return tl::unexpected(lights.error());
  }
  plan.rig.lights = *std::move(lights);
  for (size_t k = 0; k < plan.rig.lights.size(); ++k) {
    const NumberRow& rgb = tables->intensities[k];
    Light& light = plan.rig.lights[k];
    light.flux_rgb = Eigen::Vector3d(rgb.values[0], rgb.values[1], rgb.values[2]);
    if (const Status status = light.Validate(rgb.place); !status) {
      return tl::unexpected(status.error());
    }
    plan.lit.emplace_back(1, FrameFile{dir / tables->names[k].text, 1.0, std::nullopt});
  }
  const std::string intensities = (dir / "light_intensities.txt").string();
  if (const Status fit = plan.rig.Validate(intensities); !fit) {
    return tl::unexpected(fit.error());
  }
  return plan;
}

Result<ReadPlan> PlanLightsFolder(const fs::path& dir, const fs::path& lights_file) {
  ReadPlan plan;
  plan.layout = "lights.txt";
  const Result<std::vector<std::string>> names = FilesInNaturalOrder(dir);
  if (!names) {
    return tl::unexpected(names.error());
  }
  const std::vector<std::string> images = SelectImages(*names, plan);
  if (images.empty()) {
    return Fail(ErrorCode::kBadData,
                "{}: found {}, no photograph among them; need one for each light of {}",
                dir.string(), DescribeFolder(dir), lights_file.string());
  }
  Result<Lights> lights = ReadLightTable(lights_file, plan.sha256_of_input);
  if (!lights) {
    return tl::unexpected(lights.error());
  }
  if (lights->size() != images.size()) {
    return Fail(ErrorCode::kBadData,
                "{}: found {} images, {} to {}, but {} lights in {}; need one image for each light",
                dir.string(), images.size(), images.front(), images.back(), lights->size(),
                lights_file.string());
  }
  plan.rig.lights = *std::move(lights);
  for (const std::string& image : images) {
    plan.lit.emplace_back(1, FrameFile{dir / image, 1.0, std::nullopt});
  }
  return plan;
}

Result<ReadPlan> PlanPhotographs(const fs::path& dir) {
  ReadPlan plan;
  plan.layout = "photographs";
  Result<std::vector<std::string>> names = FilesInNaturalOrder(dir);
  if (!names) {
    return tl::unexpected(names.error());
  }
  std::erase_if(*names, IsReferenceName);
  for (const std::string& image : SelectImages(*names, plan)) {
    plan.lit.emplace_back(1, FrameFile{dir / image, 1.0, std::nullopt});
    Light light;
    light.name = fs::path(image).stem().string();
    plan.rig.lights.push_back(light);
  }
  if (plan.lit.empty()) {
    return Fail(ErrorCode::kBadData,
                "{}: found {}, no photograph among them; need one for each light", dir.string(),
                DescribeFolder(dir));
  }
  const Result<std::optional<fs::path>> mask = FindMask(dir);
  if (!mask) {
    return tl::unexpected(mask.error());
  }
  plan.mask = *mask;
  return plan;
}

Status FindCompanions(const fs::path& dir, const fs::path& shared_dir, bool find_mask,
                      ReadPlan& plan) {
  plan.truth = FindPublicTruth(dir);
  if (!plan.truth) {
    plan.truth = FindPublicTruth(shared_dir);
  }
  if (!find_mask) {
    return {};
  }
  const Result<std::optional<fs::path>> mask = FindMask(dir);
  if (!mask) {
    return tl::unexpected(mask.error());
  }
  plan.mask = *mask;
  if (!plan.mask) {
    plan.mask = FindSharedMask(ParentOf(dir));
    plan.mask_is_shared = plan.mask.has_value();
  }
  return {};
}

}  // namespace sateen
