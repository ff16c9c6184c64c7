#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

// A DNG written by hand, so that every number that must come back is known.
namespace sateen::testing {

inline constexpr std::array<std::array<uint8_t, 4>, 4> kBayerOrders = {
    {{0, 1, 1, 2}, {2, 1, 1, 0}, {1, 0, 2, 1}, {1, 2, 0, 1}}};

struct Entry {
  uint16_t tag;
  uint16_t type;  // 1 BYTE, 2 ASCII, 3 SHORT, 4 LONG, 5 RATIONAL
  std::vector<uint32_t> values;
};

inline void Append(std::string& bytes, uint32_t value, size_t width) {
  for (size_t i = 0; i < width; ++i) {
    bytes += static_cast<char>(value >> (8 * i) & 0xFF);
  }
}

inline std::vector<uint32_t> Text(const std::string& text) {
  std::vector<uint32_t> values(text.begin(), text.end());
  values.push_back(0);
  return values;
}

// One TIFF directory that starts at `offset`, with what does not fit in its entries after it.
inline std::string Directory(const std::vector<Entry>& entries, size_t offset) {
  std::string table;
  std::string rest;
  Append(table, static_cast<uint32_t>(entries.size()), 2);
  const size_t rest_offset = offset + 2 + 12 * entries.size() + 4;
  for (const Entry& entry : entries) {
    const size_t width = entry.type <= 2 ? 1 : entry.type == 3 ? 2 : 4;
    const size_t count = entry.type == 5 ? entry.values.size() / 2 : entry.values.size();
    Append(table, entry.tag, 2);
    Append(table, entry.type, 2);
    Append(table, static_cast<uint32_t>(count), 4);
    std::string values;
    for (const uint32_t value : entry.values) {
      Append(values, value, width);
    }
    values.resize((values.size() + 3) / 4 * 4);
    if (values.size() > 4) {
      Append(table, static_cast<uint32_t>(rest_offset + rest.size()), 4);
      rest += values;
    } else {
      values.resize(4);
      table += values;
    }
  }
  Append(table, 0, 4);
  return table + rest;
}

struct DngSpec {
  uint32_t width = 66;
  uint32_t height = 50;
  std::vector<uint32_t> cfa = {0, 1, 1, 2};
  uint32_t cfa_side = 2;
  uint32_t colours = 1;                 // 3 writes a linear DNG
  std::vector<uint32_t> black = {100};  // row by row, `black_columns` in a row
  uint32_t black_columns = 1;
  uint32_t white = 4000;
  std::vector<uint32_t> active_area = {};  // top, left, bottom, right
  bool with_exposure = true;
};

// The sensor reading at a site, in DN.
inline uint16_t Reading(uint32_t x, uint32_t y) {
  return static_cast<uint16_t>(50 + (x * 37 + y * 101) % 3900);
}

inline std::string DngBytes(const DngSpec& spec) {
  std::string pixels;
  for (uint32_t y = 0; y < spec.height; ++y) {
    for (uint32_t x = 0; x < spec.width * spec.colours; ++x) {
      Append(pixels, Reading(x, y), 2);
    }
  }
  const auto pixels_offset = uint32_t{8};
  const auto exif_offset = static_cast<uint32_t>(8 + pixels.size());
  const std::string exif =
      Directory({{33434, 5, {1, 50}}, {33437, 5, {56, 10}}, {34855, 3, {200}}}, exif_offset);
  std::vector<Entry> entries = {
      {254, 4, {0}},
      {256, 4, {spec.width}},
      {257, 4, {spec.height}},
      {258, 3, std::vector<uint32_t>(spec.colours, 16)},
      {259, 3, {1}},
      {262, 3, {spec.colours == 1 ? 32803U : 34892U}},
      {271, 2, Text("Sateen")},
      {272, 2, Text("Test Camera")},
      {273, 4, {pixels_offset}},
      {277, 3, {spec.colours}},
      {278, 4, {spec.height}},
      {279, 4, {static_cast<uint32_t>(pixels.size())}},
  };
  if (spec.colours == 1) {
    entries.push_back({33421, 3, {spec.cfa_side, spec.cfa_side}});
    entries.push_back({33422, 1, spec.cfa});
  }
  if (spec.with_exposure) {
    entries.push_back({34665, 4, {exif_offset}});
  }
  entries.push_back({50706, 1, {1, 4, 0, 0}});
  entries.push_back({50708, 2, Text("Sateen Test Camera")});
  entries.push_back(
      {50713,
       3,
       {static_cast<uint32_t>(spec.black.size()) / spec.black_columns, spec.black_columns}});
  entries.push_back({50714, 4, spec.black});
  entries.push_back({50717, 4, {spec.white}});
  entries.push_back({50728, 5, {1, 4, 1, 2, 2, 5}});  // neutral 0.25, 0.5, 0.4
  if (!spec.active_area.empty()) {
    entries.push_back({50829, 4, spec.active_area});
  }
  std::string bytes("II*\0", 4);
  Append(bytes, static_cast<uint32_t>(exif_offset + exif.size()), 4);
  return bytes + pixels + exif + Directory(entries, exif_offset + exif.size());
}

}  // namespace sateen::testing
