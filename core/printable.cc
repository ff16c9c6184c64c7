#include "core/printable.h"

#include <fmt/format.h>

#include <cstdint>

namespace sateen {
namespace {

// The character at the beginning of a text.
struct Character {
  std::size_t size = 1;  // in bytes
  bool is_utf8 = false;
  bool is_cut = false;     // whether more bytes could make it one
  std::uint32_t code = 0;  // where is_utf8
};

Character FirstOf(std::string_view text) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned first = byte(0);
  if (first < 0x80) {
    return {.is_utf8 = true, .code = first};
  }
  if (first < 0xC2 || first > 0xF4) {
    return {};
  }
  const std::size_t size = first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
  std::uint32_t code = first & (0x7FU >> size);
  for (std::size_t k = 1; k < size; ++k) {
    if (k == text.size()) {
      return {.is_cut = true};
    }
    // The second byte tells apart what is too long a form, a surrogate, or above U+10FFFF.
    const unsigned least = k > 1 ? 0x80 : first == 0xE0 ? 0xA0 : first == 0xF0 ? 0x90 : 0x80;
    const unsigned most = k > 1 ? 0xBF : first == 0xED ? 0x9F : first == 0xF4 ? 0x8F : 0xBF;
    if (byte(k) < least || byte(k) > most) {
      return {};
    }
    code = code << 6 | (byte(k) & 0x3FU);
  }
  return {.size = size, .is_utf8 = true, .code = code};
}

// Appends the printable form of a character to `out`.
void Append(std::string_view bytes, const Character& character, std::string& out) {
  if (!character.is_utf8 ||
      (character.code < 0x20 && character.code != '\n' && character.code != '\t')) {
    out += fmt::format("\\x{:02X}", static_cast<unsigned char>(bytes[0]));
  } else if (character.code >= 0x7F && character.code < 0xA0) {
    out += fmt::format("\\u{:04x}", character.code);
  } else {
    out += bytes;
  }
}

// Moves whole characters from `text` to the text that is returned.
std::string TakePrintable(std::string& text, bool nothing_follows) {
  std::string out;
  out.reserve(text.size());
  std::size_t at = 0;
  while (at < text.size()) {
    const std::string_view rest = std::string_view(text).substr(at);
    const Character character = FirstOf(rest);
    if (character.is_cut && !nothing_follows) {
      break;
    }
    Append(rest.substr(0, character.size), character, out);
    at += character.size;
  }
  text.erase(0, at);
  return out;
}

}  // namespace

std::string Printable(std::string_view text) {
  std::string waiting(text);
  return TakePrintable(waiting, /*nothing_follows=*/true);
}

PrintableStream::PrintableStream(std::ostream& sink) : std::ostream(nullptr), sink_(sink) {
  rdbuf(static_cast<std::streambuf*>(this));
}

PrintableStream::~PrintableStream() { Pass(/*nothing_follows=*/true); }

int PrintableStream::overflow(int byte) {
  if (byte == std::char_traits<char>::eof()) {
    return 0;
  }
  const char text = std::char_traits<char>::to_char_type(byte);
  return xsputn(&text, 1) == 1 ? byte : std::char_traits<char>::eof();
}

std::streamsize PrintableStream::xsputn(const char* text, std::streamsize size) {
  waiting_.append(text, static_cast<std::size_t>(size));
  return Pass(/*nothing_follows=*/false) ? size : 0;
}

int PrintableStream::sync() { return sink_.flush() ? 0 : -1; }

bool PrintableStream::Pass(bool nothing_follows) {
  const std::string printable = TakePrintable(waiting_, nothing_follows);
  return static_cast<bool>(
      sink_.write(printable.data(), static_cast<std::streamsize>(printable.size())));
}

}  // namespace sateen
