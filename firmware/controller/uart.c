#include "firmware/controller/uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "firmware/protocol/messages.h"

#define BAUD SATEEN_BAUD
#include <util/setbaud.h>

/* Positions count modulo 256, the size of the rings. A ring is empty where they are equal, so one
 * position stays free. */
static volatile uint8_t received[256];
static volatile uint8_t received_head;
static volatile uint8_t received_tail;
static volatile uint8_t unsent[256];
static volatile uint8_t unsent_head;
static volatile uint8_t unsent_tail;
static volatile uint16_t overruns;

void UartInit(void) {
  UBRR0 = UBRR_VALUE;
  UCSR0A = USE_2X ? _BV(U2X0) : 0;
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

/* A misread byte stays in its place: the CRC of its frame finds it. */
ISR(USART_RX_vect) {
  const uint8_t errors = UCSR0A & (_BV(FE0) | _BV(DOR0));
  const uint8_t byte = UDR0;
  const uint8_t next = received_head + 1;
  const uint8_t full = next == received_tail;
  if ((errors || full) && overruns != 0xffff) {
    ++overruns;
  }
  if (!full) {
    received[received_head] = byte;
    received_head = next;
  }
}

ISR(USART_UDRE_vect) {
  if (unsent_tail == unsent_head) {
    UCSR0B &= (uint8_t)~_BV(UDRIE0);
    return;
  }
  UDR0 = unsent[unsent_tail];
  ++unsent_tail;
}

uint8_t UartWaiting(void) { return received_head != received_tail; }

uint8_t UartTake(uint8_t* byte) {
  if (!UartWaiting()) {
    return 0;
  }
  *byte = received[received_tail];
  ++received_tail;
  return 1;
}

uint8_t UartSend(const uint8_t* bytes, uint8_t count) {
  if ((uint8_t)(unsent_tail - unsent_head - 1) < count) {
    return 0;
  }
  for (uint8_t i = 0; i < count; ++i) {
    unsent[unsent_head] = bytes[i];
    ++unsent_head;
  }
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { UCSR0B |= _BV(UDRIE0); }
  return 1;
}

uint16_t UartOverruns(void) {
  uint16_t count;
  ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { count = overruns; }
  return count;
}

void UartDrain(void) {
  while (unsent_tail != unsent_head) {
  }
  while (!(UCSR0A & _BV(UDRE0))) {
  }
}
