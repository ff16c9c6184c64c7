// Prints docs/protocol.md from the table of messages; --check FILE compares instead.
#include <fmt/format.h>

#include <fstream>
#include <iostream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/protocol/codec.h"
#include "firmware/protocol/frame.h"

namespace {

constexpr const char* kHow = "build/release/bin/sateen_protocol_doc > docs/protocol.md";

struct Field {
  std::string type;
  std::string name;
  std::string range;
  std::string text;
};

std::string Lower(std::string name) {
  for (char& letter : name) {
    letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  }
  return name;
}

#define FIELD(type, name, range, text) {#type, #name, range, text},
#define ARRAY(type, name, count, range, text) \
  {fmt::format("{}[{}]", #type, static_cast<int>(count)), #name, range, text},

void AppendMessage(std::string& out, const std::string& name, int id, int size,
                   const std::string& answer, std::string_view text,
                   const std::vector<Field>& fields) {
  out += fmt::format("### 0x{:02x} `{}`\n{}", id, Lower(name), text);
  if (!answer.empty()) {
    out += fmt::format(" Answered by `{}`.", Lower(answer));
  }
  if (fields.empty()) {
    out += " No payload.\n\n";
    return;
  }
  out += fmt::format(" Payload of {} byte{}:\n\n", size, size == 1 ? "" : "s");
  out += "| field | type | unit or range | meaning |\n| --- | --- | --- | --- |\n";
  for (const Field& field : fields) {
    out +=
        fmt::format("| `{}` | {} | {} | {} |\n", field.name, field.type, field.range, field.text);
  }
  out += '\n';
}

void AppendIntroduction(std::string& out) {
  out += fmt::format(
      "# The LED board's protocol\n"
      "Printed from `firmware/protocol/messages.h` by `{}`;\n"
      "a test compares. Do not edit.\n\n"
      "This is version {}.{}. A host and a board whose first numbers differ refuse to work "
      "together.\n\n"
      "## The wire\n"
      "{} baud, 8 data bits, no parity, one stop bit. A frame is\n\n"
      "    0x00 | COBS( length | sequence | message | payload ... | CRC low | CRC high ) | 0x00\n\n"
      "with `length` the bytes of the payload, at most {}, and CRC-16/CCITT-FALSE (polynomial "
      "0x1021, start\n"
      "0xffff) over everything before it. Numbers are unsigned and little-endian. No frame is "
      "longer than {}\n"
      "bytes on the wire.\n\n",
      kHow, SATEEN_PROTOCOL_MAJOR, SATEEN_PROTOCOL_MINOR, static_cast<unsigned long>(SATEEN_BAUD),
      static_cast<int>(SATEEN_MAX_PAYLOAD), static_cast<int>(SATEEN_MAX_WIRE));
  out += fmt::format(
      "## Rules\n"
      "* The host sends one command and waits for its answer, which bears its sequence number, 1 "
      "to 255.\n"
      "* No answer in time: the host sends the very same frame again. The board knows the last "
      "command that it\n"
      "  executed by sequence number and CRC, does not execute it again, and answers with the "
      "state as it is now.\n"
      "* The next command takes the next sequence number. The number of the last command with "
      "other contents is\n"
      "  refused.\n"
      "* A frame that is not good changes nothing, is counted, and is answered by `bad_frame`.\n"
      "* After a start of the board every command but `hello`, `status` and `all_off` is refused, "
      "so that no host\n"
      "  lights a lamp of a board whose restart it has not noticed.\n"
      "* Without a good frame for {} ms the board turns everything off; if anything was on, that "
      "is a fault.\n"
      "* The board enforces max level and max on-time of each light itself, from its timer "
      "interrupt.\n\n",
      SATEEN_SILENCE_MS);
}

#define REQUEST(NAME, Name, id, ANSWER, text)                        \
  AppendMessage(out, #NAME, id, SATEEN_##NAME##_SIZE, #ANSWER, text, \
                {SATEEN_##NAME##_FIELDS(FIELD, ARRAY)});
#define ANSWER(NAME, Name, id, text) REQUEST(NAME, Name, id, , text)

void AppendMessages(std::string& out) {
  out += "## Host to board\n";
  SATEEN_REQUESTS(REQUEST)
  out += "## Board to host\n";
  SATEEN_ANSWERS(ANSWER)
}

#define NUMBER(NAME, number, text) \
  out += fmt::format("| {} | {} | {} |\n", number, Lower(#NAME), text);
#define BIT(NAME, number, text) \
  out += fmt::format("| 0x{:02x} | {} | {} |\n", number, Lower(#NAME), text);

void AppendNumbers(std::string& out) {
  const std::string head = "| number | name | meaning |\n| --- | --- | --- |\n";
  out += "## Results\n" + head;
  SATEEN_RESULTS(NUMBER)
  out += "\n## Faults\n" + head;
  SATEEN_FAULTS(NUMBER)
  out += "\n## Reset causes\nBits; 0 where a bootloader hid the cause.\n\n" + head;
  SATEEN_RESET_CAUSES(BIT)
  out += "\n## Problems of a frame\n" + head;
  SATEEN_FRAME_STATUSES(NUMBER)
}

}  // namespace

int main(int argc, char** argv) {
  std::string text;
  AppendIntroduction(text);
  AppendMessages(text);
  AppendNumbers(text);
  if (argc == 1) {
    std::cout << text << std::flush;
    return std::cout ? 0 : 4;
  }
  if (argc != 3 || std::string_view(argv[1]) != "--check") {
    std::cerr << "usage: sateen_protocol_doc [--check FILE]\n";
    return 2;
  }
  std::ifstream file(argv[2], std::ios::binary);
  std::ostringstream found;
  found << file.rdbuf();
  if (found.str() != text) {
    std::cerr << argv[2] << " is not what the table of messages says; run " << kHow << '\n';
    return 3;
  }
  return 0;
}
