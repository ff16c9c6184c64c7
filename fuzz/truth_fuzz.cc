// Any bytes go for a MATLAB file of true normals. What is read has the size of the frames.
#include "fuzz/target.h"
#include "scanner/sessions/truth.h"

namespace sateen::fuzz {

void Try(std::string_view bytes) {
  constexpr ImageSize kSize = {3, 2};
  std::map<std::string, std::string> hashes;
  const TruthFiles files{FileOf("Normal_gt.mat", bytes), std::nullopt};
  const auto truth = ReadTruth(files, kSize, hashes);
  Need(truth || truth.error().code != ErrorCode::kOutOfMemory);
  if (truth) {
    Need(truth->normal.Size() == kSize);
  }
}

}  // namespace sateen::fuzz
