#include "core/printable.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

namespace sateen::printable_test {
namespace {

// What a terminal obeys: every byte below 0x20 but newline and tab, DEL, and the same as C1.
bool IsHarmless(const std::string& text) {
  for (size_t k = 0; k < text.size(); ++k) {
    const auto byte = static_cast<unsigned char>(text[k]);
    const auto next = static_cast<unsigned char>(k + 1 < text.size() ? text[k + 1] : 0);
    if ((byte < 0x20 && byte != '\n' && byte != '\t') || byte == 0x7F ||
        (byte == 0xC2 && next < 0xA0)) {
      return false;
    }
  }
  // The library refuses what is not UTF-8.
  try {
    return !nlohmann::json(text).dump().empty();
  } catch (const nlohmann::json::exception&) {
    return false;
  }
}

TEST(Printable, ShowsControlsAndKeepsTheRest) {
  EXPECT_EQ(Printable("a\tb\nc"), "a\tb\nc");
  EXPECT_EQ(Printable("\x1b[2Jled\r\a"), "\\x1B[2Jled\\x0D\\x07");
  EXPECT_EQ(Printable(std::string_view("\0", 1)), "\\x00");
  EXPECT_EQ(Printable("\x7f"), "\\u007f");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "31m"),
            "\\u009b31m");
  EXPECT_EQ(Printable("\x9b"
                      "31m"),
            "\\x9B31m");  // the same control as a byte
  EXPECT_EQ(Printable("Köper µ 織 🧵"), "Köper µ 織 🧵");
  EXPECT_EQ(Printable("\xc0\x9b"), "\\xC0\\x9B");           // too long a form
  EXPECT_EQ(Printable("\xed\xa0\x80"), "\\xED\\xA0\\x80");  // a surrogate
  EXPECT_EQ(Printable("\xf4\x90\x80\x80"), "\\xF4\\x90\\x80\\x80");
  EXPECT_EQ(Printable("\xe7\xb9"), "\\xE7\\xB9");  // cut off
}

TEST(Printable, IsHarmlessForEveryPairOfBytesAndForRandomOnes) {
  for (int first = 0; first < 256; ++first) {
    for (int second = 0; second < 256; ++second) {
      const std::string text = {static_cast<char>(first), static_cast<char>(second), 'x'};
      ASSERT_TRUE(IsHarmless(Printable(text))) << first << " " << second;
    }
  }
  std::mt19937 random(1);
  for (int k = 0; k < 2000; ++k) {
    std::string text;
    for (int n = 0; n < 40; ++n) {
      text += static_cast<char>(random());
    }
    const std::string printable = Printable(text);
    ASSERT_TRUE(IsHarmless(printable));
    ASSERT_EQ(Printable(printable), printable);
  }
}

TEST(PrintableStream, PutsCharactersTogetherThatComeInParts) {
  std::mt19937 random(2);
  for (int k = 0; k < 500; ++k) {
    std::string text = k == 0 ? "織\xc2\x9b" : "";
    for (int n = 0; n < 30; ++n) {
      text += static_cast<char>(random() % 2 == 0 ? random() : 0xC0 + random() % 48);
    }
    std::ostringstream sink;
    {
      PrintableStream stream(sink);
      for (size_t at = 0; at < text.size();) {
        const size_t size = std::min<size_t>(random() % 4, text.size() - at);
        stream << std::string_view(text).substr(at, size);
        at += size;
      }
    }
    ASSERT_EQ(sink.str(), Printable(text));
  }
}

TEST(PrintableStream, FailsWhereItsSinkFails) {
  std::ostream broken(nullptr);
  PrintableStream stream(broken);
  stream << "text";
  EXPECT_FALSE(stream.flush());
}

// Escapes of JSON mean what the characters did.
TEST(Printable, JsonStaysJson) {
  const std::string name = "led\x7f\xc2\x9b\x1b 織";
  const std::string text = nlohmann::json(name).dump();
  EXPECT_EQ(nlohmann::json::parse(Printable(text)).get<std::string>(), name);
}

}  // namespace
}  // namespace sateen::printable_test
