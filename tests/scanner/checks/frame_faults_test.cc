#include "tests/scanner/checks/simulated_faults.h"

namespace sateen::frame_faults_test {
namespace {

TEST(CheckCapture, FindsWhatGoesWrongOnWovenCloth) {
  testing::ExpectFaultsAreFound({"twill", "plain", "knit", "rib"}, 0);
}

}  // namespace
}  // namespace sateen::frame_faults_test
