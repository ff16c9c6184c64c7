#include "pipelines/calibrate/response_record.h"

#include "core/angle.h"

namespace sateen {
namespace {

ChannelLinearityRecord RecordOf(const ChannelLinearity& channel) {
  ChannelLinearityRecord record{.from_dn = channel.linear_from_dn,
                                .to_dn = channel.linear_to_dn,
                                .departs = channel.departs,
                                .fine_to_dn = channel.fine_to_dn,
                                .saturation_dn = channel.saturation_dn};
  std::vector<LinearityBinRecord>& bins = record.bins.emplace();
  for (const LinearityBin& bin : channel.bins) {
    bins.push_back({.level_dn = bin.level_dn, .deviation = bin.deviation, .sd = bin.sd});
  }
  return record;
}

NoiseRecord RecordOf(const PhotonTransfer& transfer) {
  return {.gain_dn_per_electron = transfer.gain_dn_per_electron,
          .gain_sd = transfer.gain_sd,
          .gain_rgb = transfer.gain_rgb,
          .gain_rgb_sd = transfer.gain_rgb_sd,
          .read_noise_dn = transfer.read_noise_dn,
          .read_noise_sd = transfer.read_noise_sd,
          .misfit = transfer.misfit,
          .points = transfer.points.size()};
}

std::vector<LightBalanceRecord> BalancesOf(const ResponseCalibration& result) {
  std::vector<LightBalanceRecord> records;
  for (size_t k = 0; k < result.fit.lights.size(); ++k) {
    if (const std::optional<LightBalance>& balance = result.fit.lights[k]) {
      records.push_back({.name = result.rig.lights[k].name,
                         .white_balance = balance->white_balance,
                         .white_balance_sd = balance->sd,
                         .patches = balance->patches});
    }
  }
  return records;
}

}  // namespace

ResponseRecord RecordOf(const ResponseCalibration& result) {
  const ResponseFit& fit = result.fit;
  const Eigen::Isometry2d& pose = result.capture.pose.table_from_chart;
  ResponseRecord record;
  FillCommon("response", result, record);
  record.frames = result.capture.readings.frames.size();
  record.chart = {.at_mm = pose.translation(),
                  .turned_deg = Eigen::Rotation2Dd(pose.linear()).angle() / kRadPerDeg,
                  .misfit = result.capture.pose.misfit};
  record.black_dn = fit.black_dn;
  record.saturation_dn = fit.saturation_dn;
  record.white_dn = fit.white_dn;
  record.tolerance = result.tolerance;
  record.linearity = {.red = RecordOf(fit.linearity.rgb[0]),
                      .green = RecordOf(fit.linearity.rgb[1]),
                      .blue = RecordOf(fit.linearity.rgb[2])};
  record.noise.emplace();
  if (fit.transfer) {
    *record.noise = RecordOf(*fit.transfer);
  }
  record.white_balance = fit.white_balance;
  record.white_balance_sd = fit.white_balance_sd;
  record.lights = BalancesOf(result);
  std::vector<UnevenPatchRecord>& left_out = record.left_out.emplace();
  for (const UnevenPatch& uneven : fit.uneven) {
    left_out.push_back({.light = result.rig.lights[uneven.light].name,
                        .patch = result.capture.readings.patch_names[uneven.patch],
                        .unevenness = uneven.unevenness});
  }
  if (result.errors) {
    record.error = {.white_balance = result.errors->white_balance,
                    .gain = result.errors->gain,
                    .read_noise = result.errors->read_noise,
                    .saturation = result.errors->saturation};
  }
  return record;
}

ResponseRecord WithoutBins(ResponseRecord record) {
  LinearityRecord& linearity = record.linearity.value();
  for (std::optional<ChannelLinearityRecord>* channel :
       {&linearity.red, &linearity.green, &linearity.blue}) {
    channel->value().bins.reset();
  }
  return record;
}

}  // namespace sateen
