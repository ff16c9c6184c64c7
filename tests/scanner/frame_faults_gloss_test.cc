#include "tests/scanner/simulated_faults.h"

namespace sateen {
namespace {

TEST(CheckCapture, FindsWhatGoesWrongOnPrintGlossAndRipples) {
  testing::ExpectFaultsAreFound({"print", "satin", "velvet", "ripples"}, 100);
}

}  // namespace
}  // namespace sateen
