#ifndef SATEEN_FIRMWARE_CONTROLLER_UART_H_
#define SATEEN_FIRMWARE_CONTROLLER_UART_H_

/* The serial port, by interrupts, over two rings of 255 bytes. */

#include <stdint.h>

void UartInit(void);

/* Whether a byte has been received and not taken. Call with interrupts off to sleep upon it. */
uint8_t UartWaiting(void);
/* Takes a byte; 0 if there is none. */
uint8_t UartTake(uint8_t* byte);
/* Queues all bytes, or none and returns 0 where there is no room. Never waits. */
uint8_t UartSend(const uint8_t* bytes, uint8_t count);
/* Bytes lost or misread so far; stays at 65535. */
uint16_t UartOverruns(void);
/* Waits until all bytes have gone to the transmitter, at most 6 ms; interrupts are on. */
void UartDrain(void);

#endif
