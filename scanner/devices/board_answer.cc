#include "scanner/devices/board_answer.h"

#include <algorithm>
#include <bit>
#include <iterator>

namespace sateen {
namespace {

using std::chrono::milliseconds;

// Shortest silence after which a board may turn off: a light is kept on by a word every 250 ms, and
// a word that is lost is sent again for half a second.
constexpr unsigned kShortestSilenceMs = 1000;

unsigned BitOf(std::uint8_t channel) { return channel < 16 ? 1U << channel : 0U; }

// Checks that what is said lies in [least, most]. Returns what is wrong.
std::string Outside(const char* what, unsigned said, unsigned least, unsigned most) {
  return said >= least && said <= most
             ? ""
             : fmt::format("{} is {}; need {} to {}", what, said, least, most);
}

std::string OutOfRange(const SateenGreeting& said) {
  std::string wrong = Outside("'channels'", said.channels, 1, SATEEN_MAX_CHANNELS);
  const auto also = [&](const char* what, unsigned value, unsigned least, unsigned most) {
    if (wrong.empty()) {
      wrong = Outside(what, value, least, most);
    }
  };
  also("'max_lit'", said.max_lit, 1, said.channels);
  also("'dim_clock'", said.dim_clock, 0, 2);
  also("'sync_edge'", said.sync_edge, 0, 1);
  also("'silence_ms'", said.silence_ms, kShortestSilenceMs, SATEEN_SILENCE_MS);
  for (std::size_t k = 0; k < std::min<std::size_t>(said.channels, SATEEN_MAX_CHANNELS); ++k) {
    also(fmt::format("'max_level_permille' of light {}", k).c_str(), said.max_level_permille[k], 0,
         SATEEN_FULL_LEVEL);
    also(fmt::format("'max_on_ms' of light {}", k).c_str(), said.max_on_ms[k], 1,
         SATEEN_LONGEST_ON_MS);
  }
  const auto printable = [](std::uint8_t letter) { return letter >= 0x20 && letter < 0x7F; };
  if (wrong.empty() &&
      !std::all_of(std::begin(said.build_id), std::end(said.build_id), printable)) {
    wrong = "'build_id' holds bytes that are no letters";
  }
  return wrong;
}

// Finds what no state can hold, whatever was asked.
std::string Impossible(const SateenState& said, const BoardInfo& board) {
  const std::size_t channels = board.lights.size();
  if (said.lit >> channels != 0) {
    return fmt::format("{} are on, and it has lights 0 to {}", LightsText(said.lit), channels - 1);
  }
  const unsigned lit = said.lit;
  if (std::popcount(lit) > board.settings.max_lit) {
    return fmt::format("{} are on, and no more than {} may be", LightsText(lit),
                       board.settings.max_lit);
  }
  if ((lit == 0) != (said.level_permille == 0)) {
    return fmt::format("{} is on at a level of {} of 1000", LightsText(lit), said.level_permille);
  }
  for (std::size_t k = 0; k < channels; ++k) {
    const double limit = SATEEN_FULL_LEVEL * board.lights[k].max_level;
    if ((lit >> k & 1U) != 0 && said.level_permille > limit + 0.5) {
      return fmt::format("light {} is on at {} of 1000, above its limit of {:.0f}", k,
                         said.level_permille, limit);
    }
  }
  if (lit == 0 && (said.lit_ms != 0 || said.left_ms != 0)) {
    return fmt::format("no light is on for {} ms and for another {} ms", said.lit_ms, said.left_ms);
  }
  if (said.lit_ms > SATEEN_LONGEST_ON_MS || said.left_ms > SATEEN_LONGEST_ON_MS) {
    return fmt::format("a light is on for {} ms and for another {} ms; the longest is {} ms",
                       said.lit_ms, said.left_ms, SATEEN_LONGEST_ON_MS);
  }
  if (said.armed != SATEEN_NO_CHANNEL && said.armed >= channels) {
    return fmt::format("light {} is armed, and it has lights 0 to {}", said.armed, channels - 1);
  }
  return Outside("'shutter_ms'", said.shutter_ms, 0, SATEEN_LONGEST_PRESS_MS);
}

// Finds an output that is on where all must be off.
std::string NotDark(const SateenState& said) {
  if (said.lit != 0) {
    return fmt::format("{} {} on", LightsText(said.lit),
                       std::popcount(said.lit) > 1 ? "are" : "is");
  }
  if (said.armed != SATEEN_NO_CHANNEL) {
    return fmt::format("light {} is armed for the flash sync", said.armed);
  }
  return said.shutter_ms == 0 ? "" : "the shutter output is closed";
}

std::string Either(const std::string& first, const std::string& second) {
  return first.empty() ? second : first;
}

std::string NotLit(const SateenSetLight& command, const SateenState& said,
                   const BoardAsked& asked) {
  const unsigned wanted = BitOf(command.channel);
  if (said.lit == 0 && asked.took + milliseconds(1) >= milliseconds(command.on_ms)) {
    return "";  // its time is over
  }
  const bool fits = command.add != 0 ? (said.lit & wanted) != 0 : said.lit == wanted;
  if (!fits) {
    return fmt::format("{} {} on, not {}{}", LightsText(said.lit),
                       std::popcount(said.lit) > 1 ? "are" : "is", LightsText(wanted),
                       command.add != 0 ? "" : " alone");
  }
  if (said.level_permille != command.level_permille) {
    return fmt::format("light {} is on at {} of 1000, not at {}", command.channel,
                       said.level_permille, command.level_permille);
  }
  return said.left_ms <= command.on_ms ? ""
                                       : fmt::format("light {} stays on for {} ms, not for {} ms",
                                                     command.channel, said.left_ms, command.on_ms);
}

}  // namespace

Status CheckGreeting(const SateenGreeting& said, const std::string& port) {
  const std::string wrong = OutOfRange(said);
  return wrong.empty() ? Status()
                       : Fail(ErrorCode::kDevice,
                              "{}: in the board's greeting {}; is it Sateen's firmware? 'make "
                              "flash' uploads it",
                              port, wrong);
}

std::string Contradiction(const SateenSetLight& command, const SateenState& said,
                          const BoardAsked& asked) {
  if (command.level_permille > 0) {
    return Either(Impossible(said, asked.board), NotLit(command, said, asked));
  }
  const bool still_on = command.add != 0 ? (said.lit & BitOf(command.channel)) != 0 : said.lit != 0;
  return Either(Impossible(said, asked.board), still_on ? NotDark(said) : "");
}

std::string Contradiction(const SateenAllOff& /*command*/, const SateenState& said,
                          const BoardAsked& asked) {
  return Either(NotDark(said), Impossible(said, asked.board));
}

std::string Contradiction(const SateenStatus& /*command*/, const SateenState& said,
                          const BoardAsked& asked) {
  return Impossible(said, asked.board);
}

std::string Contradiction(const SateenArm& command, const SateenState& said,
                          const BoardAsked& asked) {
  // The flash sync may have fired it already, and it may be off again.
  const bool fits = (said.lit & ~BitOf(command.channel)) == 0 &&
                    (said.armed == command.channel || said.armed == SATEEN_NO_CHANNEL);
  return Either(Impossible(said, asked.board),
                fits ? ""
                     : fmt::format("{} on and light {} armed, not light {}", LightsText(said.lit),
                                   said.armed, command.channel));
}

std::string Contradiction(const SateenTriggerShutter& command, const SateenState& said,
                          const BoardAsked& asked) {
  return Either(Impossible(said, asked.board),
                Outside("'shutter_ms'", said.shutter_ms, 0, command.press_ms));
}

std::string Contradiction(const SateenLimitLight& /*command*/, const SateenState& said,
                          const BoardAsked& asked) {
  return Either(NotDark(said), Impossible(said, asked.board));
}

std::string Contradiction(const SateenConfigure& /*command*/, const SateenState& said,
                          const BoardAsked& asked) {
  return Either(NotDark(said), Impossible(said, asked.board));
}

std::string Contradiction(const SateenClearFault& command, const SateenState& said,
                          const BoardAsked& asked) {
  const bool stays = command.fault != SATEEN_FAULT_NONE && said.fault == command.fault;
  return Either(Impossible(said, asked.board),
                stays ? fmt::format("fault {} is still there", said.fault) : "");
}

std::string Contradiction(const SateenHang& /*command*/, const SateenState& said,
                          const BoardAsked& asked) {
  return Impossible(said, asked.board);
}

}  // namespace sateen
