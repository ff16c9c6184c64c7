#pragma once

#include <ostream>
#include <streambuf>
#include <string>
#include <string_view>

namespace sateen {

// Returns the text as a terminal may have it, whatever it came from: a terminal obeys control
// characters, and a light's name or a camera's model may hold any.
//
//     kept       newline, tab, printable ASCII, and UTF-8 that is no control character
//     "\x1B"     other bytes below 0x20, and bytes that are no UTF-8
//     "\u009B"   DEL and the controls U+0080 to U+009F; in JSON this means what it did
[[nodiscard]] std::string Printable(std::string_view text);

// Passes everything that is written to it on to `sink`, Printable(). A character may come in parts.
// `sink` outlives it.
class PrintableStream : private std::streambuf, public std::ostream {
 public:
  explicit PrintableStream(std::ostream& sink);
  PrintableStream(const PrintableStream&) = delete;
  PrintableStream& operator=(const PrintableStream&) = delete;
  ~PrintableStream() override;

 private:
  int overflow(int byte) override;
  std::streamsize xsputn(const char* text, std::streamsize size) override;
  int sync() override;
  // Writes what has come; keeps the beginning of a character unless nothing follows.
  bool Pass(bool nothing_follows);

  std::ostream& sink_;
  std::string waiting_;
};

}  // namespace sateen
