#include "firmware/protocol/frame.h"

#include "firmware/protocol/codec.h"

/* Every message fits into a frame. */
#define SATEEN_CHECK_SIZE(NAME, Name, id, ANSWER, text) \
  typedef char Sateen##Name##Fits[(int)SATEEN_##NAME##_SIZE <= (int)SATEEN_MAX_PAYLOAD ? 1 : -1];
#define SATEEN_CHECK_ANSWER_SIZE(NAME, Name, id, text) SATEEN_CHECK_SIZE(NAME, Name, id, , text)
SATEEN_REQUESTS(SATEEN_CHECK_SIZE)
SATEEN_ANSWERS(SATEEN_CHECK_ANSWER_SIZE)

/* The polynomial 0x1021 eight bits at a time, without a table. avr-libc has the same in assembly, five
 * times as fast. */
#ifdef __AVR__
#include <util/crc16.h>
uint16_t SateenCrc16(uint16_t crc, uint8_t byte) { return _crc_xmodem_update(crc, byte); }
#else
uint16_t SateenCrc16(uint16_t crc, uint8_t byte) {
  uint8_t x = (uint8_t)((crc >> 8) ^ byte);
  x = (uint8_t)(x ^ (x >> 4));
  return (uint16_t)((uint16_t)(crc << 8) ^ (uint16_t)((uint16_t)x << 12) ^
                    (uint16_t)((uint16_t)x << 5) ^ x);
}
#endif

/* A run of COBS in the making: `code` is where the count of its bytes goes. */
typedef struct Stuffer {
  uint8_t* to;
  uint8_t* code;
} Stuffer;

/* A frame is shorter than 254 bytes, so a run never reaches the longest that COBS allows. */
static void Stuff(Stuffer* stuffer, uint8_t byte) {
  if (byte != 0) {
    *stuffer->to++ = byte;
    return;
  }
  *stuffer->code = (uint8_t)(stuffer->to - stuffer->code);
  stuffer->code = stuffer->to++;
}

uint8_t SateenEncodeFrame(uint8_t sequence, uint8_t message, const uint8_t* payload, uint8_t length,
                          uint8_t wire[SATEEN_MAX_WIRE]) {
  const uint8_t head[3] = {length, sequence, message};
  uint16_t crc = 0xffff;
  Stuffer stuffer = {wire + 2, wire + 1};
  wire[0] = 0;
  for (uint8_t i = 0; i < (uint8_t)(3 + length); ++i) {
    const uint8_t byte = i < 3 ? head[i] : payload[i - 3];
    crc = SateenCrc16(crc, byte);
    Stuff(&stuffer, byte);
  }
  Stuff(&stuffer, (uint8_t)(crc & 0xff));
  Stuff(&stuffer, (uint8_t)(crc >> 8));
  *stuffer.code = (uint8_t)(stuffer.to - stuffer.code);
  *stuffer.to++ = 0;
  return (uint8_t)(stuffer.to - wire);
}

/* In place. Returns the number of decoded bytes, or 0 if `bytes` is no COBS encoding. */
static uint8_t Unstuff(uint8_t* bytes, uint8_t count) {
  uint8_t to = 0;
  uint8_t from = 0;
  while (from < count) {
    const uint8_t code = bytes[from++];
    if ((uint8_t)(code - 1) > (uint8_t)(count - from)) {
      return 0;
    }
    for (uint8_t i = 1; i < code; ++i) {
      bytes[to++] = bytes[from++];
    }
    if (from < count) {
      bytes[to++] = 0;
    }
  }
  return to;
}

static uint8_t Decode(uint8_t* bytes, uint8_t encoded, SateenFrame* frame) {
  const uint8_t count = Unstuff(bytes, encoded);
  uint16_t crc = 0xffff;
  if (count < SATEEN_FRAME_OVERHEAD) {
    return SATEEN_FRAME_BAD_COBS;
  }
  if (bytes[0] != (uint8_t)(count - SATEEN_FRAME_OVERHEAD)) {
    return SATEEN_FRAME_BAD_LENGTH;
  }
  for (uint8_t i = 0; i < (uint8_t)(count - 2); ++i) {
    crc = SateenCrc16(crc, bytes[i]);
  }
  if (bytes[count - 2] != (uint8_t)(crc & 0xff) || bytes[count - 1] != (uint8_t)(crc >> 8)) {
    return SATEEN_FRAME_BAD_CRC;
  }
  frame->length = bytes[0];
  frame->sequence = bytes[1];
  frame->message = bytes[2];
  frame->crc = crc;
  frame->payload = bytes + 3;
  return SATEEN_FRAME_GOOD;
}

uint8_t SateenReceive(SateenReceiver* receiver, uint8_t byte, SateenFrame* frame) {
  uint8_t status = SATEEN_FRAME_NONE;
  if (byte != 0) {
    if (receiver->count < sizeof(receiver->bytes)) {
      receiver->bytes[receiver->count++] = byte;
    } else {
      receiver->too_long = 1;
    }
    return SATEEN_FRAME_NONE;
  }
  if (receiver->too_long) {
    status = SATEEN_FRAME_TOO_LONG;
  } else if (receiver->count > 0) {
    status = Decode(receiver->bytes, receiver->count, frame);
  }
  receiver->count = 0;
  receiver->too_long = 0;
  return status;
}
