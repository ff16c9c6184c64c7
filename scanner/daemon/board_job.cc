#include "scanner/daemon/board_job.h"

namespace sateen {
namespace {

Status CheckChannel(const BoardChange& change, const LightBoard& board) {
  const int channels = static_cast<int>(board.Info().lights.size());
  const bool known = !change.channel || (*change.channel >= 0 && *change.channel < channels);
  return known ? Status{}
               : Fail(ErrorCode::kInvalidArgument, "channel {}: the board has lights 0 to {}",
                      *change.channel, channels - 1);
}

bool ChangesLimits(const BoardChange& change) { return change.max_level || change.max_on; }

bool ChangesBoard(const BoardChange& change) {
  return ChangesLimits(change) || change.max_lit || change.dim_clock || change.sync_rising;
}

Status ChangeLimits(const BoardChange& change, LightBoard& board) {
  if (!ChangesLimits(change)) {
    return {};
  }
  const int first = change.channel.value_or(0);
  const int last = change.channel.value_or(static_cast<int>(board.Info().lights.size()) - 1);
  for (int channel = first; channel <= last; ++channel) {
    const auto index = static_cast<std::size_t>(channel);
    const LightLimits old = board.Info().lights[index];
    const Result<BoardState> set =
        board.Limit(channel, {.max_level = change.max_level.value_or(old.max_level),
                              .max_on = change.max_on.value_or(old.max_on)});
    if (!set) {
      return tl::unexpected(set.error());
    }
  }
  return {};
}

Status ChangeSettings(const BoardChange& change, LightBoard& board) {
  if (!change.max_lit && !change.dim_clock && !change.sync_rising) {
    return {};
  }
  BoardSettings settings = board.Info().settings;
  settings.max_lit = change.max_lit.value_or(settings.max_lit);
  settings.dim_clock = change.dim_clock.value_or(settings.dim_clock);
  settings.sync_rising = change.sync_rising.value_or(settings.sync_rising);
  const Result<BoardState> set = board.Configure(settings);
  return set ? Status{} : tl::unexpected(set.error());
}

}  // namespace

Result<BoardWord> ChangeBoard(const BoardChange& change, LightBoard& board) {
  if (const Status known = CheckChannel(change, board); !known) {
    return tl::unexpected(known.error());
  }
  if (change.clear_fault) {
    const Result<BoardReport> before = board.Report();
    if (!before) {
      return tl::unexpected(before.error());
    }
    if (const auto cleared = board.ClearFault(before->state.fault); !cleared) {
      return tl::unexpected(cleared.error());
    }
  }
  Status changed = ChangeLimits(change, board);
  if (changed) {
    changed = ChangeSettings(change, board);
  }
  if (!changed) {
    return tl::unexpected(changed.error());
  }
  const Result<BoardReport> report = board.Report();
  if (!report) {
    return tl::unexpected(report.error());
  }
  if (ChangesBoard(change) && report->state.lit != 0) {
    return Fail(ErrorCode::kDevice,
                "{}: setting limits turns everything off, but the board says: {} on; look at the "
                "lights, and cut their supply if one is on",
                board.PortName(), LightsText(report->state.lit));
  }
  return BoardWord{.port = board.PortName(), .info = board.Info(), .report = *report};
}

}  // namespace sateen
