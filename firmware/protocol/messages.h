#ifndef SATEEN_FIRMWARE_PROTOCOL_MESSAGES_H_
#define SATEEN_FIRMWARE_PROTOCOL_MESSAGES_H_

/* The table of all messages between the LED board and its host. The dispatch of the firmware, the
 * codec of both sides (codec.h) and docs/protocol.md are made from it, so that a message is changed
 * here and nowhere else. C99 and C++; no code, only lists for the preprocessor.
 *
 * A list of fields names each with its type (u8, u16, u32; little-endian on the wire), its unit or
 * range, and its meaning. F is one value, A an array. Fields are sent in this order, without gaps.
 *
 * Anything that is added at the end of a list raises the minor version; any other change raises the
 * major one, and then board and host refuse to work together. */
#define SATEEN_PROTOCOL_MAJOR 1
#define SATEEN_PROTOCOL_MINOR 0

/* 8 data bits, no parity, one stop bit; exact on a 16 MHz ATmega328P. */
#define SATEEN_BAUD 500000UL
/* Bits of a mask of lights, and entries of a list of limits; a board may have fewer lights. */
#define SATEEN_MAX_CHANNELS 16
#define SATEEN_BUILD_ID_SIZE 8
#define SATEEN_NO_CHANNEL 255
/* Full level. Levels are parts of the time that the dimming line is high. */
#define SATEEN_FULL_LEVEL 1000
#define SATEEN_LONGEST_ON_MS 60000
#define SATEEN_LONGEST_PRESS_MS 10000
/* Without a good frame from the host for this long the board turns everything off. */
#define SATEEN_SILENCE_MS 2000

/* ---- host to board -------------------------------------------------------------------------- */

#define SATEEN_HELLO_FIELDS(F, A)                                      \
  F(u8, protocol_major, "version", "of the host; must be the board's") \
  F(u8, protocol_minor, "version", "of the host")

#define SATEEN_SET_LIGHT_FIELDS(F, A)                                                            \
  F(u8, channel, "0 ... channels - 1", "the light")                                              \
  F(u16, level_permille, "0 ... its max level", "0 turns this light off")                        \
  F(u16, on_ms, "1 ... its max on-time", "off after this long, unless another command is first") \
  F(u8, add, "0, 1", "0 turns all other lights off first; 1 keeps them, up to max_lit")

#define SATEEN_ALL_OFF_FIELDS(F, A)

#define SATEEN_STATUS_FIELDS(F, A)

#define SATEEN_ARM_FIELDS(F, A)                                               \
  F(u8, channel, "0 ... channels - 1", "the light that the flash sync fires") \
  F(u16, level_permille, "1 ... its max level", "when fired")                 \
  F(u16, on_ms, "1 ... its max on-time", "off this long after the sync")

#define SATEEN_TRIGGER_SHUTTER_FIELDS(F, A) \
  F(u16, press_ms, "1 ... 10000", "how long the shutter output is closed")

#define SATEEN_LIMIT_LIGHT_FIELDS(F, A)                         \
  F(u8, channel, "0 ... channels - 1", "the light")             \
  F(u16, max_level_permille, "0 ... 1000", "0 never lights it") \
  F(u16, max_on_ms, "1 ... 60000", "longest time that it is on without a break")

#define SATEEN_CONFIGURE_FIELDS(F, A)                                                    \
  F(u8, max_lit, "1 ... channels", "lights that may be on together; they share a level") \
  F(u8, dim_clock, "0, 1, 2", "frequency of the dimming line: 16 kHz, 2 kHz, 250 Hz")    \
  F(u8, sync_edge, "0, 1", "edge of the flash-sync input that fires: 0 falling, 1 rising")

#define SATEEN_CLEAR_FAULT_FIELDS(F, A) \
  F(u8, fault, "fault number", "cleared if it is the one that the board reports")

#define SATEEN_HANG_FIELDS(F, A) \
  F(u8, interrupts, "0, 1", "0 hangs with interrupts off, 1 with interrupts on")

/* ---- board to host -------------------------------------------------------------------------- */

#define SATEEN_GREETING_FIELDS(F, A)                                                               \
  F(u8, protocol_major, "version", "of the board")                                                 \
  F(u8, protocol_minor, "version", "of the board")                                                 \
  F(u8, channels, "1 ... 16", "how many lights the board has")                                     \
  F(u8, max_lit, "1 ... channels", "lights that may be on together")                               \
  F(u8, dim_clock, "0, 1, 2", "frequency of the dimming line: 16 kHz, 2 kHz, 250 Hz")              \
  F(u8, sync_edge, "0, 1", "edge of the flash-sync input that fires: 0 falling, 1 rising")         \
  F(u16, silence_ms, "1000 ... 2000 ms",                                                           \
    "after this long without a good frame everything is turned off")                               \
  F(u8, reset_cause, "bits", "why the board last started (table below)")                           \
  F(u8, fault, "fault number", "the latest fault that was not cleared, 0 for none")                \
  A(u8, build_id, SATEEN_BUILD_ID_SIZE, "ASCII", "start of the SHA-256 of the firmware's sources") \
  A(u16, max_level_permille, SATEEN_MAX_CHANNELS, "0 ... 1000", "of each light")                   \
  A(u16, max_on_ms, SATEEN_MAX_CHANNELS, "1 ... 60000", "of each light")

/* State of the outputs. */
#define SATEEN_STATE_FIELDS(F, A)                                                      \
  F(u8, request, "message id", "of the command that this answers; 0 if none")          \
  F(u8, result, "result number", "0: done; else nothing was changed")                  \
  F(u8, fault, "fault number", "the latest fault that was not cleared, 0 for none")    \
  F(u16, lit, "bit k: light k", "the lights that are on")                              \
  F(u16, level_permille, "0 ... 1000", "of the lights that are on, 0 if none is")      \
  F(u16, lit_ms, "ms", "how long the light that went on first has been on")            \
  F(u16, left_ms, "ms", "until the first of them goes off")                            \
  F(u8, armed, "channel", "the light that waits for the flash sync; 255 if none does") \
  F(u16, shutter_ms, "ms", "how much longer the shutter output is closed")

#define SATEEN_REPORT_FIELDS(F, A)                                                       \
  SATEEN_STATE_FIELDS(F, A)                                                              \
  F(u8, reset_cause, "bits", "why the board last started (table below)")                 \
  F(u32, uptime_ms, "ms", "since then")                                                  \
  F(u32, frames, "count", "good frames received")                                        \
  F(u16, bad_frames, "count", "frames received that were not good; 65535 and up: 65535") \
  F(u16, overruns, "count", "bytes lost or misread by the receiver, likewise")           \
  F(u16, refused, "count", "commands refused, likewise")                                 \
  F(u16, repeats, "count", "commands received again and not executed again, likewise")   \
  F(u16, unsent, "count", "answers that found no room to be sent, likewise")             \
  F(u16, syncs, "count", "edges of the flash sync, likewise")                            \
  F(u16, flashes, "count", "lights fired by the flash sync, likewise")                   \
  F(u16, faults, "count", "faults since the start, likewise")

#define SATEEN_BAD_FRAME_FIELDS(F, A)                               \
  F(u8, problem, "problem number", "what was wrong with the frame") \
  F(u16, bad_frames, "count", "bad frames since the start, this one too")

#define SATEEN_FAULT_FIELDS(F, A)                                  \
  F(u8, fault, "fault number", "what happened; everything is off") \
  F(u16, lit, "bit k: light k", "the lights that were on")

/* ---- the table of messages ------------------------------------------------------------------ */

/* X(NAME, Name, id, ANSWER, what it does) */
#define SATEEN_REQUESTS(X)                                                                         \
  X(HELLO, Hello, 0x01, GREETING,                                                                  \
    "Starts a session: turns everything off and forgets the last sequence number. Until it has "   \
    "come, every command but `status` and `all_off` is refused.")                                  \
  X(SET_LIGHT, SetLight, 0x02, STATE,                                                              \
    "Turns a light on, or changes the level of one that is on. Its on-time limit runs from when "  \
    "it "                                                                                          \
    "went on. Once a light has reached that limit, which is a fault, none is turned on until the " \
    "fault is cleared or the host says hello.")                                                    \
  X(ALL_OFF, AllOff, 0x03, STATE, "Turns all lights off, disarms, and opens the shutter output.")  \
  X(STATUS, Status, 0x04, REPORT,                                                                  \
    "Changes nothing. Also what a host sends that wants a light to "                               \
    "stay on: any good frame tells the board that it is there.")                                   \
  X(ARM, Arm, 0x05, STATE,                                                                         \
    "Turns all lights off; the next edge of the flash sync turns this one on, once.")              \
  X(TRIGGER_SHUTTER, TriggerShutter, 0x06, STATE, "Closes the shutter output for a while.")        \
  X(LIMIT_LIGHT, LimitLight, 0x07, STATE,                                                          \
    "Turns everything off and stores the limits of a light in the EEPROM. Takes up to 100 ms.")    \
  X(CONFIGURE, Configure, 0x08, STATE,                                                             \
    "Turns everything off and stores settings of the board in the EEPROM. Takes up to 100 ms.")    \
  X(CLEAR_FAULT, ClearFault, 0x09, STATE, "Acknowledges a fault.")                                 \
  X(HANG, Hang, 0x7e, STATE,                                                                       \
    "Test builds only, elsewhere an unknown message: answers, then hangs until the watchdog "      \
    "resets the board.")

/* X(NAME, Name, id, when it is sent) */
#define SATEEN_ANSWERS(X)                                                                         \
  X(STATE, State, 0x80, "Answers a command: the state after it.")                                 \
  X(GREETING, Greeting, 0x81, "Answers `hello`; sent with sequence 0 whenever the board starts.") \
  X(REPORT, Report, 0x84, "Answers `status`: the state and the counters.")                        \
  X(BAD_FRAME, BadFrame, 0xf0,                                                                    \
    "Sequence 0: the board received a frame that was not good and did nothing. Send it again.")   \
  X(FAULT, Fault, 0xf1, "Sequence 0: something went wrong and the board turned everything off.")

/* ---- numbers; the words are the host's ------------------------------------------------------ */

/* X(NAME, number, what it means) */
#define SATEEN_RESULTS(X)                                                             \
  X(DONE, 0, "done")                                                                  \
  X(UNKNOWN_MESSAGE, 1, "the board does not know this message")                       \
  X(WRONG_SIZE, 2, "the payload has not the size of this message")                    \
  X(NOT_GREETED, 3, "the board has started anew and waits for hello")                 \
  X(WRONG_PROTOCOL, 4, "the board speaks another version of the protocol")            \
  X(SEQUENCE_REUSED, 5, "the sequence number is that of another command just before") \
  X(OUT_OF_RANGE, 6, "a value is out of its range")                                   \
  X(OVER_LIMIT, 7, "level or on-time is above the limit of this light")               \
  X(TOO_MANY_LIT, 8, "as many lights are on as may be on together")                   \
  X(OTHER_LEVEL, 9, "lights that are on together share one level, and it is another") \
  X(NOT_STORED, 10, "the EEPROM did not take the values")

/* X(NAME, number, what happened) */
#define SATEEN_FAULTS(X)                                                                          \
  X(NONE, 0, "none")                                                                              \
  X(WATCHDOG, 1, "the firmware hung and the watchdog restarted the board")                        \
  X(BROWN_OUT, 2, "the supply voltage fell too low and the board restarted")                      \
  X(HOST_SILENT, 3, "nothing was heard from the host for two seconds with an output on")          \
  X(ON_TIME_LIMIT, 4, "a light reached its longest on-time before it was to go off")              \
  X(LIMITS_LOST, 5,                                                                               \
    "the limits in the EEPROM are damaged; all lights are held to 10 % and 1 s until limits are " \
    "set")

/* Bits as in the MCUSR register of the ATmega328P. 0: a bootloader hid the cause. */
#define SATEEN_RESET_CAUSES(X)                                                   \
  X(POWER_ON, 0x01, "power was switched on")                                     \
  X(EXTERNAL, 0x02, "the reset line, as opening the serial port does on an Uno") \
  X(BROWN_OUT, 0x04, "the supply voltage fell too low")                          \
  X(WATCHDOG, 0x08, "the watchdog")

/* Outcomes of receiving a frame. NONE and GOOD are no problems: more bytes are needed, and it is
 * whole. */
#define SATEEN_FRAME_STATUSES(X)                                    \
  X(NONE, 0, "no frame has ended yet")                              \
  X(GOOD, 1, "a whole frame")                                       \
  X(TOO_LONG, 2, "longer than any frame can be")                    \
  X(BAD_COBS, 3, "not a COBS encoding, or too short to be a frame") \
  X(BAD_LENGTH, 4, "its length byte is not its length")             \
  X(BAD_CRC, 5, "its CRC does not fit")

#endif /* SATEEN_FIRMWARE_PROTOCOL_MESSAGES_H_ */
