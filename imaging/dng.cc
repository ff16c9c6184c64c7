#include "imaging/dng.h"

#include <tiffio.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <string_view>
#include <utility>

#include "core/check.h"
#include "core/files/output_folder.h"
#include "core/option_range.h"

namespace sateen {
namespace {

constexpr uint16_t kD65 = 21;  // EXIF LightSource

// ---- Header -------------------------------------------------------------------------------------

Status CheckWhole(const char* name, double value, double least, double most) {
  if (!(value >= least && value <= most) || value != std::floor(value)) {
    return Fail(ErrorCode::kInvalidArgument, "{} = {}; need a whole number from {} to {}", name,
                value, least, most);
  }
  return {};
}

Status CheckCfa(const std::array<uint8_t, 4>& cfa) {
  const bool upright = cfa[1] == 1 && cfa[2] == 1 && cfa[0] + cfa[3] == 2 && cfa[0] != 1;
  const bool other = cfa[0] == 1 && cfa[3] == 1 && cfa[1] + cfa[2] == 2 && cfa[1] != 1;
  if (!upright && !other) {
    return Fail(ErrorCode::kInvalidArgument,
                "cfa = {} {} {} {}; need 0 (red), 2 (blue) and two 1 (green) on a diagonal", cfa[0],
                cfa[1], cfa[2], cfa[3]);
  }
  return {};
}

// LibRaw keeps 63 characters and drops spaces at the end.
Status CheckName(const char* name, std::string_view text) {
  const bool printable = std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; });
  if (text.empty() || text.size() > 63 || !printable || text.front() == ' ' || text.back() == ' ') {
    return Fail(ErrorCode::kInvalidArgument,
                "{} = '{}'; need 1 to 63 printable ASCII characters without a space at either end",
                name, text);
  }
  return {};
}

Status CheckDateTime(const std::string& text) {
  constexpr std::string_view kForm = "dddd:dd:dd dd:dd:dd";
  const auto fits = [](char c, char form) {
    return form == 'd' ? c >= '0' && c <= '9' : c == form;
  };
  const auto number = [&text](size_t at) { return std::stoi(text.substr(at, 2)); };
  if (!std::ranges::equal(text, kForm, fits) || number(5) < 1 || number(5) > 12 || number(8) < 1 ||
      number(8) > 31 || number(11) > 23 || number(14) > 59 || number(17) > 59) {
    return Fail(ErrorCode::kInvalidArgument, "date_time = '{}'; need YYYY:MM:DD HH:MM:SS", text);
  }
  return {};
}

Status CheckLevels(double black, double white) {
  if (Status status = CheckWhole("black", black, 0.0, 65534.0); !status) {
    return status;
  }
  if (Status status = CheckWhole("white", white, 1.0, 65535.0); !status) {
    return status;
  }
  if (black >= white) {
    return Fail(ErrorCode::kInvalidArgument, "black = {}; need less than white = {}", black, white);
  }
  return {};
}

// ---- A file in memory ---------------------------------------------------------------------------
// libtiff's error handlers are global and belong to whoever set them (OpenImageIO does), so they
// stay as they are. Nothing speaks to them: tags are checked before, and memory refuses no write,
// as there is room from the start.

struct MemoryFile {
  std::string bytes;
  uint64_t place = 0;
};

tmsize_t ReadMemory(thandle_t handle, void* to, tmsize_t wanted) {
  MemoryFile& file = *static_cast<MemoryFile*>(handle);
  const uint64_t size = file.bytes.size();
  const uint64_t count = std::min(static_cast<uint64_t>(wanted), size - std::min(file.place, size));
  if (count > 0) {
    std::memcpy(to, file.bytes.data() + file.place, count);
  }
  file.place += count;
  return static_cast<tmsize_t>(count);
}

tmsize_t WriteMemory(thandle_t handle, void* from, tmsize_t count) {
  MemoryFile& file = *static_cast<MemoryFile*>(handle);
  const size_t n = static_cast<size_t>(count);
  try {
    if (file.bytes.size() < file.place) {
      file.bytes.resize(file.place);
    }
    const size_t replaced = std::min(n, file.bytes.size() - file.place);
    file.bytes.replace(file.place, replaced, static_cast<const char*>(from), n);
  } catch (const std::exception&) {  // out of memory; must not fly through C
    return -1;
  }
  file.place += n;
  return count;
}

toff_t SeekMemory(thandle_t handle, toff_t offset, int from) {
  MemoryFile& file = *static_cast<MemoryFile*>(handle);
  file.place = offset + (from == SEEK_CUR ? file.place : from == SEEK_END ? file.bytes.size() : 0);
  return file.place;
}

int CloseMemory(thandle_t /*handle*/) { return 0; }

toff_t SizeOfMemory(thandle_t handle) { return static_cast<MemoryFile*>(handle)->bytes.size(); }

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};

// ---- Tags ---------------------------------------------------------------------------------------

class DngWriter {
 public:
  explicit DngWriter(MemoryFile& file)
      // w: write, l: little-endian
      : tiff_(TIFFClientOpen("dng", "wl", &file, ReadMemory, WriteMemory, SeekMemory, CloseMemory,
                             SizeOfMemory, nullptr, nullptr)),
        good_(tiff_ != nullptr) {}

  // Returns whether all was written.
  bool Write(const Image<uint16_t>& mosaic, const DngHeader& header) {
    const uint64_t exif_offset = WriteExif(header);
    if (exif_offset != 0) {
      Set(TIFFTAG_EXIFIFD, exif_offset);
    }
    SetPicture(mosaic.Size());
    SetNames(header);
    SetCfa(header);
    SetColour(header);
    const auto bytes = static_cast<tmsize_t>(mosaic.pixels.size() * sizeof(uint16_t));
    // libtiff's pointer is not const, but it changes pixels only to compress them or to swap bytes.
    static_assert(std::endian::native == std::endian::little);
    good_ =
        good_ && TIFFWriteEncodedStrip(tiff_.get(), 0, const_cast<uint16_t*>(mosaic.pixels.data()),
                                       bytes) == bytes;
    good_ = good_ && TIFFWriteDirectory(tiff_.get()) == 1;
    return good_;
  }

 private:
  template <typename... Values>
  void Set(uint32_t tag, Values... values) {
    good_ = good_ && TIFFSetField(tiff_.get(), tag, values...) == 1;
  }

  // Writes it before the picture's own directory, which names its place. Returns 0 if there is
  // nothing to write.
  uint64_t WriteExif(const DngHeader& header) {
    if (!header.exposure_s && !header.f_number && !header.iso && !header.date_time) {
      return 0;
    }
    good_ = good_ && TIFFCreateEXIFDirectory(tiff_.get()) == 0;
    if (header.exposure_s) {
      Set(EXIFTAG_EXPOSURETIME, *header.exposure_s);
    }
    if (header.f_number) {
      Set(EXIFTAG_FNUMBER, *header.f_number);
    }
    if (header.iso) {
      const auto iso = static_cast<uint16_t>(*header.iso);
      Set(EXIFTAG_ISOSPEEDRATINGS, 1, &iso);
    }
    if (header.date_time) {
      Set(EXIFTAG_DATETIMEORIGINAL, header.date_time->c_str());
    }
    uint64_t offset = 0;
    good_ = good_ && TIFFWriteCustomDirectory(tiff_.get(), &offset) == 1;
    if (good_) {  // back to the tags of a picture
      TIFFFreeDirectory(tiff_.get());
      TIFFCreateDirectory(tiff_.get());
    }
    return offset;
  }

  void SetPicture(ImageSize size) {
    Set(TIFFTAG_SUBFILETYPE, 0);
    Set(TIFFTAG_IMAGEWIDTH, size.width);
    Set(TIFFTAG_IMAGELENGTH, size.height);
    Set(TIFFTAG_ROWSPERSTRIP, size.height);
    Set(TIFFTAG_BITSPERSAMPLE, 16);
    Set(TIFFTAG_SAMPLESPERPIXEL, 1);
    Set(TIFFTAG_COMPRESSION, COMPRESSION_NONE);
    Set(TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_CFA);
    Set(TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    Set(TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT);
  }

  void SetNames(const DngHeader& header) {
    constexpr std::array<uint8_t, 4> kVersion = {1, 4, 0, 0};
    constexpr std::array<uint8_t, 4> kReadableBy = {1, 1, 0, 0};
    const std::string unique_model = header.make + " " + header.model;
    Set(TIFFTAG_MAKE, header.make.c_str());
    Set(TIFFTAG_MODEL, header.model.c_str());
    Set(TIFFTAG_SOFTWARE, "Sateen");
    if (header.date_time) {
      Set(TIFFTAG_DATETIME, header.date_time->c_str());
    }
    Set(TIFFTAG_DNGVERSION, kVersion.data());
    Set(TIFFTAG_DNGBACKWARDVERSION, kReadableBy.data());
    Set(TIFFTAG_UNIQUECAMERAMODEL, unique_model.c_str());
  }

  void SetCfa(const DngHeader& header) {
    constexpr std::array<uint16_t, 2> kRepeat = {2, 2};
    constexpr std::array<uint8_t, 3> kPlanes = {0, 1, 2};
    constexpr int kRectangular = 1;
    Set(TIFFTAG_CFAREPEATPATTERNDIM, kRepeat.data());
    Set(TIFFTAG_CFAPATTERN, 4, header.cfa.data());
    Set(TIFFTAG_CFAPLANECOLOR, 3, kPlanes.data());
    Set(TIFFTAG_CFALAYOUT, kRectangular);
    std::array<float, 4> black = {};
    black.fill(static_cast<float>(header.black));
    const auto white = static_cast<uint32_t>(header.white);
    Set(TIFFTAG_BLACKLEVELREPEATDIM, kRepeat.data());
    Set(TIFFTAG_BLACKLEVEL, 4, black.data());
    Set(TIFFTAG_WHITELEVEL, 1, &white);
  }

  void SetColour(const DngHeader& header) {
    const auto to_float = [](double value) { return static_cast<float>(value); };
    std::array<float, 9> matrix = {};
    std::ranges::transform(header.color_matrix, matrix.begin(), to_float);
    std::array<float, 3> neutral = {};
    std::ranges::transform(header.neutral, neutral.begin(), to_float);
    Set(TIFFTAG_COLORMATRIX1, 9, matrix.data());
    Set(TIFFTAG_CALIBRATIONILLUMINANT1, kD65);
    Set(TIFFTAG_ASSHOTNEUTRAL, 3, neutral.data());
  }

  std::unique_ptr<TIFF, CloseTiff> tiff_;
  bool good_;
};

Status CheckSize(ImageSize size) {
  constexpr int kMaxSide = 65535;
  if (size.width < 2 || size.height < 2 || size.width > kMaxSide || size.height > kMaxSide ||
      size.PixelCount() > size_t{1} << 30) {
    return Fail(ErrorCode::kInvalidArgument,
                "the mosaic is {}x{} px; need 2 to {} px a side and at most 2^30 sites", size.width,
                size.height, kMaxSide);
  }
  return {};
}

}  // namespace

Status DngHeader::Validate() const {
  Status status = CheckCfa(cfa);
  const auto require = [&status](auto check) { status = status ? check() : status; };
  require([&] { return CheckLevels(black, white); });
  require([&] { return CheckName("make", make); });
  require([&] { return CheckName("model", model); });
  for (const double value : color_matrix) {
    require([&] { return CheckRange("color_matrix", value, -100.0, 100.0); });
  }
  for (const double value : neutral) {
    require([&] { return CheckRange("neutral", value, 1e-4, 1e4); });
  }
  if (exposure_s) {
    require([&] { return CheckRange("exposure_s", *exposure_s, 1e-6, 1e5); });
  }
  if (f_number) {
    require([&] { return CheckRange("f_number", *f_number, 0.01, 1e4); });
  }
  if (iso) {
    require([&] { return CheckWhole("iso", *iso, 1.0, 65535.0); });
  }
  if (date_time) {
    require([&] { return CheckDateTime(*date_time); });
  }
  return status;
}

Result<std::string> EncodeDng(const Image<uint16_t>& mosaic, const DngHeader& header) {
  if (Status status = header.Validate(); !status) {
    return tl::unexpected(status.error());
  }
  if (Status status = CheckSize(mosaic.Size()); !status) {
    return tl::unexpected(status.error());
  }
  SATEEN_CHECK(mosaic.pixels.size() == mosaic.Size().PixelCount());
  MemoryFile file;
  constexpr size_t kTagBytes = 8192;  // they take less than one
  file.bytes.reserve(mosaic.pixels.size() * sizeof(uint16_t) + kTagBytes);
  if (!DngWriter(file).Write(mosaic, header)) {
    return Fail(ErrorCode::kIo, "libtiff cannot lay out the DNG file; memory may be short");
  }
  return std::move(file.bytes);
}

Status WriteDng(const std::filesystem::path& path, const Image<uint16_t>& mosaic,
                const DngHeader& header) {
  const Result<std::string> bytes = EncodeDng(mosaic, header);
  if (!bytes) {
    const Error& error = bytes.error();
    return error.code == ErrorCode::kIo ? Fail(error.code, "{}: {}", path.string(), error.message)
                                        : tl::unexpected(error);
  }
  return WriteFileWhole(path, *bytes);
}

}  // namespace sateen
