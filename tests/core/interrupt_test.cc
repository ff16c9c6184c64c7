#include "core/interrupt.h"

#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>

namespace sateen::interrupt_test {
namespace {

using ::testing::ExitedWithCode;
using ::testing::KilledBySignal;

// Each runs in a process of its own, since handlers and the flag belong to the whole process.
class InterruptDeathTest : public ::testing::TestWithParam<int> {};

TEST_P(InterruptDeathTest, FirstSignalSetsTheFlag) {
  const auto raise_once = [] {
    InstallInterruptHandlers();
    const bool before = InterruptFlag();
    std::raise(GetParam());
    std::exit(!before && InterruptFlag() ? 0 : 1);
  };
  EXPECT_EXIT(raise_once(), ExitedWithCode(0), "");
}

TEST_P(InterruptDeathTest, SecondSignalEndsTheProgram) {
  const auto raise_twice = [] {
    InstallInterruptHandlers();
    std::raise(GetParam());
    std::raise(GetParam());
  };
  EXPECT_EXIT(raise_twice(), KilledBySignal(GetParam()), "");
}

TEST_P(InterruptDeathTest, SignalThatWasIgnoredStaysIgnored) {
  const auto raise_ignored = [] {
    std::signal(GetParam(), SIG_IGN);
    InstallInterruptHandlers();
    std::raise(GetParam());
    std::raise(GetParam());
    std::exit(InterruptFlag() ? 1 : 0);
  };
  EXPECT_EXIT(raise_ignored(), ExitedWithCode(0), "");
}

INSTANTIATE_TEST_SUITE_P(Signals, InterruptDeathTest, ::testing::Values(SIGINT, SIGTERM, SIGHUP));

}  // namespace
}  // namespace sateen::interrupt_test
