#include "firmware/protocol/frame.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <optional>
#include <random>
#include <vector>

#include "firmware/protocol/codec.h"

namespace {

using Bytes = std::vector<std::uint8_t>;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Ne;

struct Decoded {
  int status = SATEEN_FRAME_NONE;
  int sequence = 0;
  int message = 0;
  Bytes payload;

  bool operator==(const Decoded&) const = default;
};

Bytes Encode(int sequence, int message, const Bytes& payload) {
  Bytes wire(SATEEN_MAX_WIRE);
  wire.resize(SateenEncodeFrame(static_cast<std::uint8_t>(sequence),
                                static_cast<std::uint8_t>(message), payload.data(),
                                static_cast<std::uint8_t>(payload.size()), wire.data()));
  return wire;
}

// Everything that a receiver makes of the bytes, NONE left out.
std::vector<Decoded> Receive(const Bytes& wire) {
  SateenReceiver receiver = {};
  std::vector<Decoded> decoded;
  for (const std::uint8_t byte : wire) {
    SateenFrame frame = {};
    const int status = SateenReceive(&receiver, byte, &frame);
    if (status == SATEEN_FRAME_GOOD) {
      decoded.push_back({status, frame.sequence, frame.message,
                         Bytes(frame.payload, frame.payload + frame.length)});
    } else if (status != SATEEN_FRAME_NONE) {
      decoded.push_back({.status = status});
    }
  }
  return decoded;
}

Bytes RandomBytes(std::mt19937& random, std::size_t count, int largest = 255) {
  Bytes bytes(count);
  std::ranges::generate(bytes, [&] {
    return static_cast<std::uint8_t>(std::uniform_int_distribution<int>(0, largest)(random));
  });
  return bytes;
}

TEST(Frame, CrcIsCcittFalse) {
  std::uint16_t crc = 0xffff;
  for (const char letter : std::string("123456789")) {
    crc = SateenCrc16(crc, static_cast<std::uint8_t>(letter));
  }
  EXPECT_EQ(crc, 0x29b1);  // the check value of CRC-16/CCITT-FALSE
}

TEST(Frame, IsOnTheWireAsDocumented) {
  // length 2, sequence 5, message 3, payload 0 9; zero bytes become the counts of COBS.
  const Bytes wire = Encode(5, 3, {0, 9});
  std::uint16_t crc = 0xffff;
  for (const int byte : {2, 5, 3, 0, 9}) {
    crc = SateenCrc16(crc, static_cast<std::uint8_t>(byte));
  }
  ASSERT_NE(crc & 0xff, 0);
  ASSERT_NE(crc >> 8, 0);
  EXPECT_THAT(wire, ElementsAre(0, 4, 2, 5, 3, 4, 9, crc & 0xff, crc >> 8, 0));
}

TEST(Frame, ComesBackWholeForEveryLength) {
  std::mt19937 random(1);
  for (std::size_t length = 0; length <= SATEEN_MAX_PAYLOAD; ++length) {
    for (const int largest : {0, 1, 255}) {  // all zeros, many zeros, few
      const Bytes payload = RandomBytes(random, length, largest);
      const Bytes wire = Encode(7, 0x80, payload);
      ASSERT_LE(wire.size(), static_cast<std::size_t>(SATEEN_MAX_WIRE));
      EXPECT_THAT(Bytes(wire.begin() + 1, wire.end() - 1), Each(Ne(0)));
      EXPECT_THAT(Receive(wire), ElementsAre(Decoded{SATEEN_FRAME_GOOD, 7, 0x80, payload}));
    }
  }
}

TEST(Frame, NoSingleFlippedBitIsAccepted) {
  std::mt19937 random(2);
  for (const std::size_t length : {0, 2, 6, 14, 82, 96}) {
    for (const int largest : {1, 255}) {
      const Bytes wire = Encode(3, 0x02, RandomBytes(random, length, largest));
      for (std::size_t bit = 0; bit < 8 * wire.size(); ++bit) {
        Bytes flipped = wire;
        flipped[bit / 8] = static_cast<std::uint8_t>(flipped[bit / 8] ^ (1u << (bit % 8)));
        for (const Decoded& decoded : Receive(flipped)) {
          // A delimiter in front that is none any more joins the frame; its end can only be lost.
          EXPECT_NE(decoded.status, SATEEN_FRAME_GOOD) << "length " << length << " bit " << bit;
        }
      }
    }
  }
}

TEST(Frame, NoDroppedOrInsertedByteIsAccepted) {
  std::mt19937 random(3);
  const Bytes payload = RandomBytes(random, 14, 3);
  const Bytes wire = Encode(3, 0x80, payload);
  const Decoded good{SATEEN_FRAME_GOOD, 3, 0x80, payload};
  for (std::size_t at = 1; at + 1 < wire.size(); ++at) {
    Bytes shorter = wire;
    shorter.erase(shorter.begin() + static_cast<std::ptrdiff_t>(at));
    for (const Decoded& decoded : Receive(shorter)) {
      EXPECT_NE(decoded.status, SATEEN_FRAME_GOOD) << "dropped " << at;
    }
    for (int byte = 0; byte < 256; ++byte) {
      Bytes longer = wire;
      longer.insert(longer.begin() + static_cast<std::ptrdiff_t>(at),
                    static_cast<std::uint8_t>(byte));
      for (const Decoded& decoded : Receive(longer)) {
        // A second delimiter in front of the frame is none too many.
        EXPECT_TRUE(decoded.status != SATEEN_FRAME_GOOD ||
                    (at == 1 && byte == 0 && decoded == good))
            << "inserted " << byte << " at " << at;
      }
    }
  }
}

TEST(Frame, IsFoundAfterGarbage) {
  std::mt19937 random(4);
  for (int round = 0; round < 200; ++round) {
    Bytes wire = RandomBytes(random, static_cast<std::size_t>(round));
    const Bytes frame = Encode(9, 0x04, {});
    wire.insert(wire.end(), frame.begin(), frame.end());
    EXPECT_EQ(Receive(wire).back(), (Decoded{SATEEN_FRAME_GOOD, 9, 0x04, {}}));
  }
}

TEST(Frame, SaysWhatIsWrong) {
  const auto only_status = [](const Bytes& wire) {
    const std::vector<Decoded> decoded = Receive(wire);
    return decoded.size() == 1 ? std::optional(decoded[0].status) : std::nullopt;
  };
  EXPECT_EQ(only_status({0, 0, 0}), std::nullopt);
  EXPECT_EQ(only_status({9, 1, 1, 0}), SATEEN_FRAME_BAD_COBS);        // a run beyond the end
  EXPECT_EQ(only_status({5, 1, 1, 1, 1, 0}), SATEEN_FRAME_BAD_COBS);  // four bytes are no frame
  EXPECT_EQ(only_status({6, 1, 1, 1, 1, 1, 0}), SATEEN_FRAME_BAD_LENGTH);
  Bytes wire = Encode(1, 2, {3});
  wire[5] ^= 1;
  EXPECT_EQ(only_status(wire), SATEEN_FRAME_BAD_CRC);
  Bytes endless(SATEEN_MAX_FRAME + 2, 1);
  endless.push_back(0);
  EXPECT_EQ(only_status(endless), SATEEN_FRAME_TOO_LONG);
  endless.erase(endless.begin());  // as long as a frame can be
  EXPECT_NE(only_status(endless), SATEEN_FRAME_TOO_LONG);
}

}  // namespace
