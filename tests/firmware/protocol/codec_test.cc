#include "firmware/protocol/codec.h"

#include <gmock/gmock.h>

#include <cstring>
#include <set>
#include <vector>

#include "firmware/protocol/frame.h"

namespace {

using ::testing::ElementsAre;

// Fills a payload with different bytes, unpacks it and packs it again.
template <typename Message, typename Pack, typename Unpack>
void ExpectRoundTrip(int size, Pack pack, Unpack unpack, const char* name) {
  std::vector<std::uint8_t> sent(static_cast<std::size_t>(size));
  for (std::size_t i = 0; i < sent.size(); ++i) {
    sent[i] = static_cast<std::uint8_t>(37 * i + 11);
  }
  Message message;
  unpack(sent.data(), &message);
  std::vector<std::uint8_t> again(sent.size(), 0);
  pack(&message, again.data());
  EXPECT_EQ(again, sent) << name;
}

TEST(Codec, EveryMessageComesBackByteForByte) {
#define EXPECT_REQUEST(NAME, Name, id, ANSWER, text) \
  ExpectRoundTrip<Sateen##Name>(SATEEN_##NAME##_SIZE, SateenPack##Name, SateenUnpack##Name, #Name);
#define EXPECT_ANSWER(NAME, Name, id, text) EXPECT_REQUEST(NAME, Name, id, , text)
  SATEEN_REQUESTS(EXPECT_REQUEST)
  SATEEN_ANSWERS(EXPECT_ANSWER)
}

TEST(Codec, FieldsAreLittleEndianInTheOrderOfTheTable) {
  const SateenSetLight light = {.channel = 3, .level_permille = 0x0102, .on_ms = 0x0304, .add = 1};
  std::vector<std::uint8_t> payload(SATEEN_SET_LIGHT_SIZE);
  SateenPackSetLight(&light, payload.data());
  EXPECT_THAT(payload, ElementsAre(3, 0x02, 0x01, 0x04, 0x03, 1));
  const std::uint8_t wide[] = {0x78, 0x56, 0x34, 0x12};
  std::uint32_t value = 0;
  SateenGet_u32(wide, &value);
  EXPECT_EQ(value, 0x12345678u);
}

TEST(Codec, ArraysGoOneByOne) {
  SateenGreeting greeting = {};
  std::memcpy(greeting.build_id, "01234567", SATEEN_BUILD_ID_SIZE);
  greeting.max_level_permille[1] = 1000;
  std::vector<std::uint8_t> payload(SATEEN_GREETING_SIZE);
  SateenPackGreeting(&greeting, payload.data());
  SateenGreeting back = {};
  SateenUnpackGreeting(payload.data(), &back);
  EXPECT_EQ(std::memcmp(back.build_id, "01234567", SATEEN_BUILD_ID_SIZE), 0);
  EXPECT_EQ(back.max_level_permille[0], 0);
  EXPECT_EQ(back.max_level_permille[1], 1000);
}

TEST(Codec, IdsAndNumbersAreDifferent) {
  std::multiset<int> ids;
#define INSERT_REQUEST(NAME, Name, id, ANSWER, text) ids.insert(id);
#define INSERT_ANSWER(NAME, Name, id, text) ids.insert(id);
  SATEEN_REQUESTS(INSERT_REQUEST)
  SATEEN_ANSWERS(INSERT_ANSWER)
  EXPECT_EQ(ids.size(), std::set<int>(ids.begin(), ids.end()).size());
#define EXPECT_NUMBER(NAME, number, text) EXPECT_EQ(number, next++);
  int next = 0;
  SATEEN_RESULTS(EXPECT_NUMBER)
  next = 0;
  SATEEN_FAULTS(EXPECT_NUMBER)
  next = 0;
  SATEEN_FRAME_STATUSES(EXPECT_NUMBER)
}

}  // namespace
