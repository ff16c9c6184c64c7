#include "tests/scanner/simulated_faults.h"

namespace sateen {
namespace {

TEST(CheckCapture, FindsWhatGoesWrongOnWovenCloth) {
  testing::ExpectFaultsAreFound({"twill", "plain", "knit", "rib"}, 0);
}

}  // namespace
}  // namespace sateen
