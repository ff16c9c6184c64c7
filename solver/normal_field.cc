#include "solver/normal_field.h"

#include <array>
#include <utility>

namespace sateen {
namespace {

constexpr std::array<std::pair<Backend, std::string_view>, 5> kBackendNames = {{
    {Backend::kJacobiSvd, "jacobi-svd"},
    {Backend::kQr, "qr"},
    {Backend::kLdlt, "ldlt"},
    {Backend::kFast, "fast"},
    {Backend::kAuto, "auto"},
}};

constexpr std::array<std::string_view, 3> kLobeNames = {"cloth", "ggx", "ggx-anisotropic"};

}  // namespace

std::string_view Name(Backend backend) {
  return kBackendNames[static_cast<size_t>(backend)].second;
}

std::optional<Backend> BackendNamed(std::string_view name) {
  for (const auto& [value, backend_name] : kBackendNames) {
    if (backend_name == name) {
      return value;
    }
  }
  return std::nullopt;
}

std::string_view Name(LobeModel model) { return kLobeNames[static_cast<size_t>(model)]; }

void NormalField::Resize(ImageSize size, bool with_ladder) {
  if (reason.Size() != size) {
    normal = Image3(size);
    albedo = Image3(size);
    residual = Image<float>(size);
    samples = Image<uint8_t>(size);
    reason = Image<uint8_t>(size);
  }
  const ImageSize ladder_size = with_ladder ? size : ImageSize{};
  if (model.Size() != ladder_size || albedo_uncertainty.Size() != ladder_size) {
    uncertainty = Image<float>(ladder_size);
    albedo_uncertainty = Image<float>(ladder_size);
    model = Image<uint8_t>(ladder_size);
  }
}

}  // namespace sateen
