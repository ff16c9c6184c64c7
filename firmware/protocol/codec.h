#ifndef SATEEN_FIRMWARE_PROTOCOL_CODEC_H_
#define SATEEN_FIRMWARE_PROTOCOL_CODEC_H_

/* The lists of messages.h as types and functions of C99 and C++. For a message `SetLight`:
 *
 *     SATEEN_SET_LIGHT                                       its id on the wire
 *     SateenSetLight                                         its fields
 *     SATEEN_SET_LIGHT_SIZE                                  bytes of its payload
 *     SateenPackSetLight(const SateenSetLight*, uint8_t*)    fields to payload
 *     SateenUnpackSetLight(const uint8_t*, SateenSetLight*)  and back; the size must be right
 */

#include <stdint.h>

#include "firmware/protocol/messages.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef uint8_t SateenType_u8;
typedef uint16_t SateenType_u16;
typedef uint32_t SateenType_u32;

static inline uint8_t* SateenPut_u8(uint8_t* to, uint8_t value) {
  *to++ = value;
  return to;
}
static inline uint8_t* SateenPut_u16(uint8_t* to, uint16_t value) {
  to = SateenPut_u8(to, (uint8_t)(value & 0xff));
  return SateenPut_u8(to, (uint8_t)(value >> 8));
}
static inline uint8_t* SateenPut_u32(uint8_t* to, uint32_t value) {
  to = SateenPut_u16(to, (uint16_t)(value & 0xffff));
  return SateenPut_u16(to, (uint16_t)(value >> 16));
}
static inline const uint8_t* SateenGet_u8(const uint8_t* from, uint8_t* value) {
  *value = *from++;
  return from;
}
static inline const uint8_t* SateenGet_u16(const uint8_t* from, uint16_t* value) {
  *value = (uint16_t)(from[0] | (uint16_t)((uint16_t)from[1] << 8));
  return from + 2;
}
static inline const uint8_t* SateenGet_u32(const uint8_t* from, uint32_t* value) {
  uint16_t low;
  uint16_t high;
  from = SateenGet_u16(SateenGet_u16(from, &low), &high);
  *value = (uint32_t)low | ((uint32_t)high << 16);
  return from;
}

/* Ids. */
#define SATEEN_REQUEST_ID(NAME, Name, id, ANSWER, text) SATEEN_##NAME = (id),
#define SATEEN_ANSWER_ID(NAME, Name, id, text) SATEEN_##NAME = (id),
enum SateenMessage { SATEEN_REQUESTS(SATEEN_REQUEST_ID) SATEEN_ANSWERS(SATEEN_ANSWER_ID) };

/* Sizes of messages as structs of bytes, which have no gaps. The last byte is there because a struct
 * needs a member. */
#define SATEEN_ONE_WIRE(type, name, range, text) uint8_t name[sizeof(SateenType_##type)];
#define SATEEN_ARRAY_WIRE(type, name, count, range, text) \
  uint8_t name[(count) * sizeof(SateenType_##type)];
#define SATEEN_WIRE(NAME, Name, id, ANSWER, text)                              \
  typedef struct Sateen##Name##Wire {                                          \
    SATEEN_##NAME##_FIELDS(SATEEN_ONE_WIRE, SATEEN_ARRAY_WIRE) uint8_t unused; \
  } Sateen##Name##Wire;
#define SATEEN_ANSWER_WIRE(NAME, Name, id, text) SATEEN_WIRE(NAME, Name, id, , text)
SATEEN_REQUESTS(SATEEN_WIRE)
SATEEN_ANSWERS(SATEEN_ANSWER_WIRE)
#define SATEEN_REQUEST_SIZE(NAME, Name, id, ANSWER, text) \
  SATEEN_##NAME##_SIZE = (int)sizeof(Sateen##Name##Wire) - 1,
#define SATEEN_ANSWER_SIZE(NAME, Name, id, text) SATEEN_REQUEST_SIZE(NAME, Name, id, , text)
enum SateenSize { SATEEN_REQUESTS(SATEEN_REQUEST_SIZE) SATEEN_ANSWERS(SATEEN_ANSWER_SIZE) };

/* Numbers. */
#define SATEEN_RESULT_NUMBER(NAME, number, text) SATEEN_RESULT_##NAME = (number),
#define SATEEN_FAULT_NUMBER(NAME, number, text) SATEEN_FAULT_##NAME = (number),
#define SATEEN_RESET_BIT(NAME, number, text) SATEEN_RESET_##NAME = (number),
#define SATEEN_FRAME_NUMBER(NAME, number, text) SATEEN_FRAME_##NAME = (number),
enum SateenResult { SATEEN_RESULTS(SATEEN_RESULT_NUMBER) };
enum SateenFaultNumber { SATEEN_FAULTS(SATEEN_FAULT_NUMBER) };
enum SateenResetCause { SATEEN_RESET_CAUSES(SATEEN_RESET_BIT) };
enum SateenFrameStatus { SATEEN_FRAME_STATUSES(SATEEN_FRAME_NUMBER) };

/* Structs. The last member, which is never sent, makes a message without fields a valid struct. */
#define SATEEN_ONE_MEMBER(type, name, range, text) SateenType_##type name;
#define SATEEN_ARRAY_MEMBER(type, name, count, range, text) SateenType_##type name[count];
#define SATEEN_STRUCT(NAME, Name, id, ANSWER, text)                                \
  typedef struct Sateen##Name {                                                    \
    SATEEN_##NAME##_FIELDS(SATEEN_ONE_MEMBER, SATEEN_ARRAY_MEMBER) uint8_t unused; \
  } Sateen##Name;
#define SATEEN_ANSWER_STRUCT(NAME, Name, id, text) SATEEN_STRUCT(NAME, Name, id, , text)
SATEEN_REQUESTS(SATEEN_STRUCT)
SATEEN_ANSWERS(SATEEN_ANSWER_STRUCT)

/* Pack and unpack. */
#define SATEEN_PUT_ONE(type, name, range, text) to = SateenPut_##type(to, fields->name);
#define SATEEN_PUT_ARRAY(type, name, count, range, text) \
  for (uint8_t i = 0; i < (count); ++i) {                \
    to = SateenPut_##type(to, fields->name[i]);          \
  }
#define SATEEN_GET_ONE(type, name, range, text) from = SateenGet_##type(from, &fields->name);
#define SATEEN_GET_ARRAY(type, name, count, range, text) \
  for (uint8_t i = 0; i < (count); ++i) {                \
    from = SateenGet_##type(from, &fields->name[i]);     \
  }
#define SATEEN_PACK(NAME, Name, id, ANSWER, text)                                    \
  static inline void SateenPack##Name(const Sateen##Name* fields, uint8_t* to) {     \
    SATEEN_##NAME##_FIELDS(SATEEN_PUT_ONE, SATEEN_PUT_ARRAY)(void) fields;           \
    (void)to;                                                                        \
  }                                                                                  \
  static inline void SateenUnpack##Name(const uint8_t* from, Sateen##Name* fields) { \
    SATEEN_##NAME##_FIELDS(SATEEN_GET_ONE, SATEEN_GET_ARRAY) fields->unused = 0;     \
    (void)from;                                                                      \
  }
#define SATEEN_ANSWER_PACK(NAME, Name, id, text) SATEEN_PACK(NAME, Name, id, , text)
SATEEN_REQUESTS(SATEEN_PACK)
SATEEN_ANSWERS(SATEEN_ANSWER_PACK)

#ifdef __cplusplus
}
#endif

#endif /* SATEEN_FIRMWARE_PROTOCOL_CODEC_H_ */
