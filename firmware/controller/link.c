#include "firmware/controller/link.h"

#include <avr/interrupt.h>
#include <string.h>

#include "firmware/controller/lights.h"
#include "firmware/controller/reset.h"
#include "firmware/controller/settings.h"
#include "firmware/controller/uart.h"
#include "firmware/protocol/codec.h"
#include "firmware/protocol/frame.h"

static SateenReceiver receiver;
static uint32_t frames;
static uint16_t bad_frames;
static uint16_t refused;
static uint16_t repeats;
static uint16_t unsent;
static uint8_t greeted;

/* The last command that was executed or refused, so that it is not done twice. */
static struct {
  uint8_t sequence;
  uint16_t crc;
  uint8_t result;
} last;

static void Count(uint16_t* counter) {
  if (*counter != 0xffff) {
    ++*counter;
  }
}

static void Send(uint8_t sequence, uint8_t message, const uint8_t* payload, uint8_t length) {
  uint8_t wire[SATEEN_MAX_WIRE];
  const uint8_t count = SateenEncodeFrame(sequence, message, payload, length, wire);
  if (!UartSend(wire, count)) {
    Count(&unsent);
  }
}

/* Not inlined, so that a large answer takes stack only while it is made. */
#define SEND(NAME, Name, id, text)                                                      \
  __attribute__((noinline)) static void Send##Name(uint8_t sequence, Sateen##Name* m) { \
    uint8_t payload[SATEEN_##NAME##_SIZE];                                              \
    SateenPack##Name(m, payload);                                                       \
    Send(sequence, id, payload, sizeof(payload));                                       \
  }
SATEEN_ANSWERS(SEND)

static void AnswerGREETING(uint8_t sequence, uint8_t request, uint8_t result) {
  SateenGreeting greeting;
  SateenState state;
  (void)request;
  (void)result;
  memset(&greeting, 0, sizeof(greeting));
  LightsState(&state);
  greeting.protocol_major = SATEEN_PROTOCOL_MAJOR;
  greeting.protocol_minor = SATEEN_PROTOCOL_MINOR;
  greeting.channels = SATEEN_CHANNELS;
  greeting.max_lit = settings.max_lit;
  greeting.dim_clock = settings.dim_clock;
  greeting.sync_edge = settings.sync_edge;
  greeting.silence_ms = SATEEN_SILENCE_MS;
  greeting.reset_cause = ResetCause();
  greeting.fault = state.fault;
  memcpy(greeting.build_id, SATEEN_BUILD_ID, SATEEN_BUILD_ID_SIZE);
  memcpy(greeting.max_level_permille, settings.max_level_permille,
         sizeof(settings.max_level_permille));
  memcpy(greeting.max_on_ms, settings.max_on_ms, sizeof(settings.max_on_ms));
  SendGreeting(sequence, &greeting);
}

static void AnswerSTATE(uint8_t sequence, uint8_t request, uint8_t result) {
  SateenState state;
  LightsState(&state);
  state.request = request;
  state.result = result;
  SendState(sequence, &state);
}

static void AnswerREPORT(uint8_t sequence, uint8_t request, uint8_t result) {
  SateenReport report;
  SateenState state;
  LightsState(&state);
  report.request = request;
  report.result = result;
  report.fault = state.fault;
  report.lit = state.lit;
  report.level_permille = state.level_permille;
  report.lit_ms = state.lit_ms;
  report.left_ms = state.left_ms;
  report.armed = state.armed;
  report.shutter_ms = state.shutter_ms;
  report.reset_cause = ResetCause();
  report.frames = frames;
  report.bad_frames = bad_frames;
  report.overruns = UartOverruns();
  report.refused = refused;
  report.repeats = repeats;
  report.unsent = unsent;
  LightsReport(&report);
  SendReport(sequence, &report);
}

/* ---- the commands; each returns a SateenResult ---- */

static uint8_t DoHello(const SateenHello* hello) {
  LightsHello();
  greeted = hello->protocol_major == SATEEN_PROTOCOL_MAJOR;
  return greeted ? SATEEN_RESULT_DONE : SATEEN_RESULT_WRONG_PROTOCOL;
}

static uint8_t DoSetLight(const SateenSetLight* command) { return LightsSet(command); }

static uint8_t DoAllOff(const SateenAllOff* command) {
  (void)command;
  LightsAllOff();
  return SATEEN_RESULT_DONE;
}

static uint8_t DoStatus(const SateenStatus* command) {
  (void)command;
  return SATEEN_RESULT_DONE;
}

static uint8_t DoArm(const SateenArm* command) { return LightsArm(command); }

static uint8_t DoTriggerShutter(const SateenTriggerShutter* command) {
  return LightsTriggerShutter(command);
}

static uint8_t Store(void) {
  const uint8_t stored = SettingsStore();
  LightsUseSettings();
  return stored ? SATEEN_RESULT_DONE : SATEEN_RESULT_NOT_STORED;
}

static uint8_t DoLimitLight(const SateenLimitLight* limit) {
  if (limit->channel >= SATEEN_CHANNELS || limit->max_level_permille > SATEEN_FULL_LEVEL ||
      limit->max_on_ms == 0 || limit->max_on_ms > SATEEN_LONGEST_ON_MS) {
    return SATEEN_RESULT_OUT_OF_RANGE;
  }
  LightsAllOff();
  settings.max_level_permille[limit->channel] = limit->max_level_permille;
  settings.max_on_ms[limit->channel] = limit->max_on_ms;
  return Store();
}

static uint8_t DoConfigure(const SateenConfigure* command) {
  if (command->max_lit == 0 || command->max_lit > SATEEN_CHANNELS || command->dim_clock > 2 ||
      command->sync_edge > 1) {
    return SATEEN_RESULT_OUT_OF_RANGE;
  }
  LightsAllOff();
  settings.max_lit = command->max_lit;
  settings.dim_clock = command->dim_clock;
  settings.sync_edge = command->sync_edge;
  return Store();
}

static uint8_t DoClearFault(const SateenClearFault* command) {
  LightsClearFault(command->fault);
  return SATEEN_RESULT_DONE;
}

#ifdef SATEEN_TEST_BUILD
static uint8_t hang;

static uint8_t DoHang(const SateenHang* command) {
  hang = command->interrupts ? 1 : 2;
  return SATEEN_RESULT_DONE;
}

static void HangIfTold(void) {
  if (hang == 2) {
    UartDrain();
    cli();
  }
  while (hang) {
  }
}
#else
static uint8_t DoHang(const SateenHang* command) {
  (void)command;
  return SATEEN_RESULT_UNKNOWN_MESSAGE;
}

static void HangIfTold(void) {}
#endif

/* ---- which command, and whether it may be done ---- */

static uint8_t NeedsGreeting(uint8_t message) {
  return message != SATEEN_HELLO && message != SATEEN_STATUS && message != SATEEN_ALL_OFF;
}

#define EXECUTE(NAME, Name, id, ANSWER, text)     \
  case id: {                                      \
    Sateen##Name command;                         \
    if (frame->length != SATEEN_##NAME##_SIZE) {  \
      return SATEEN_RESULT_WRONG_SIZE;            \
    }                                             \
    SateenUnpack##Name(frame->payload, &command); \
    return Do##Name(&command);                    \
  }

static uint8_t Execute(const SateenFrame* frame) {
  if (!greeted && NeedsGreeting(frame->message)) {
    return SATEEN_RESULT_NOT_GREETED;
  }
  switch (frame->message) {
    SATEEN_REQUESTS(EXECUTE)
    default:
      return SATEEN_RESULT_UNKNOWN_MESSAGE;
  }
}

/* Sequence 0 is the board's own; hello is always done, since it is what starts a count. */
static uint8_t ExecuteOnce(const SateenFrame* frame) {
  if (frame->sequence == 0) {
    return SATEEN_RESULT_OUT_OF_RANGE;
  }
  if (frame->sequence == last.sequence && frame->message != SATEEN_HELLO) {
    if (frame->crc == last.crc) {
      Count(&repeats);
      return last.result;
    }
    return SATEEN_RESULT_SEQUENCE_REUSED;
  }
  last.result = Execute(frame);
  last.sequence = frame->sequence;
  last.crc = frame->crc;
  return last.result;
}

#define ANSWER_WITH(NAME, Name, id, ANSWER, text)            \
  case id:                                                   \
    Answer##ANSWER(frame->sequence, frame->message, result); \
    break;

static void Answer(const SateenFrame* frame, uint8_t result) {
  switch (frame->message) {
    SATEEN_REQUESTS(ANSWER_WITH)
    default:
      AnswerSTATE(frame->sequence, frame->message, result);
      break;
  }
}

static void AnswerBadFrame(uint8_t problem) {
  SateenBadFrame bad = {.problem = problem};
  Count(&bad_frames);
  bad.bad_frames = bad_frames;
  SendBadFrame(0, &bad);
}

void LinkReceive(uint8_t byte) {
  SateenFrame frame;
  uint8_t result;
  const uint8_t status = SateenReceive(&receiver, byte, &frame);
  if (status == SATEEN_FRAME_NONE) {
    return;
  }
  if (status != SATEEN_FRAME_GOOD) {
    AnswerBadFrame(status);
    return;
  }
  ++frames;
  LightsHostHeard();
  result = ExecuteOnce(&frame);
  if (result != SATEEN_RESULT_DONE) {
    Count(&refused);
  }
  Answer(&frame, result);
  HangIfTold();
}

void LinkStart(void) { AnswerGREETING(0, 0, 0); }

void LinkAnnounceFault(void) {
  SateenFault fault;
  LightsTakeFault(&fault);
  SendFault(0, &fault);
}
