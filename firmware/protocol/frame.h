#ifndef SATEEN_FIRMWARE_PROTOCOL_FRAME_H_
#define SATEEN_FIRMWARE_PROTOCOL_FRAME_H_

/* Frames of the LED board's link. On the wire, in this order:
 *
 *     0x00 | COBS( length | sequence | message | payload ... | CRC low | CRC high ) | 0x00
 *
 * COBS (consistent overhead byte stuffing) leaves no zero byte between the two delimiters, so that a
 * receiver finds the next frame after any garbage. Several delimiters in a row are one.
 *
 * length    bytes of the payload, 0 to 96
 * sequence  chosen by the host, 1 to 255; an answer bears that of its command; 0: answers nothing
 * CRC       CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xffff) of all before it
 *
 * Errors    a frame that is not good is reported by its status and its bytes are dropped
 * Cost      encode and decode O(length), no allocation
 * Source    Cheshire and Baker, "Consistent overhead byte stuffing", IEEE/ACM Transactions on
 *           Networking 7(2), 1999. The order of the fields is ours. */

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SATEEN_MAX_PAYLOAD = 96,
  SATEEN_FRAME_OVERHEAD = 5,                                     /* length ... CRC */
  SATEEN_MAX_FRAME = SATEEN_MAX_PAYLOAD + SATEEN_FRAME_OVERHEAD, /* before COBS */
  SATEEN_MAX_WIRE = SATEEN_MAX_FRAME + 3                         /* COBS adds one, delimiters two */
};

typedef struct SateenFrame {
  uint8_t sequence;
  uint8_t message;
  uint8_t length;
  uint16_t crc;
  const uint8_t* payload; /* in the receiver, until it receives again */
} SateenFrame;

/* Starts as zeros. */
typedef struct SateenReceiver {
  uint8_t count;
  uint8_t too_long;
  uint8_t bytes[SATEEN_MAX_FRAME + 1];
} SateenReceiver;

/* 0xffff to start with; the CRC of bytes so far and one more. */
uint16_t SateenCrc16(uint16_t crc, uint8_t byte);

/* Returns how many bytes of `wire` are to be sent. `length` is at most SATEEN_MAX_PAYLOAD. */
uint8_t SateenEncodeFrame(uint8_t sequence, uint8_t message, const uint8_t* payload, uint8_t length,
                          uint8_t wire[SATEEN_MAX_WIRE]);

/* Takes one byte from the wire. Returns a SateenFrameStatus: NONE while no frame has ended, GOOD with
 * the frame in `*frame`, else what was wrong with the frame that ended here. */
uint8_t SateenReceive(SateenReceiver* receiver, uint8_t byte, SateenFrame* frame);

#ifdef __cplusplus
}
#endif

#endif /* SATEEN_FIRMWARE_PROTOCOL_FRAME_H_ */
