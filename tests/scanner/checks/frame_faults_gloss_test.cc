#include "tests/scanner/checks/simulated_faults.h"

namespace sateen::frame_faults_gloss_test {
namespace {

TEST(CheckCapture, FindsWhatGoesWrongOnPrintGlossAndRipples) {
  testing::ExpectFaultsAreFound({"print", "satin", "velvet", "ripples"}, 100);
}

}  // namespace
}  // namespace sateen::frame_faults_gloss_test
