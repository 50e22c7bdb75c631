/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Functions for other components; main.c exports them. */
#ifndef HM2_LBP16_EXPORTS_H
#define HM2_LBP16_EXPORTS_H

#include <stdint.h>

#include <hm2/serial.h>

int hm2_bspi_setup_chan(char *name, int chan, int cs, int bits, double mhz, int delay, int cpol, int cpha, int noclear,
                        int noecho, int samplelate);
int hm2_bspi_set_read_function(char *name, int (*func)(void *subdata), void *subdata);
int hm2_bspi_set_write_function(char *name, int (*func)(void *subdata), void *subdata);
int hm2_bspi_write_chan(char *name, int chan, uint32_t val);
int hm2_allocate_bspi_tram(char *name);
int hm2_bspi_clear_fifo(char *name);
int hm2_tram_add_bspi_frame(char *name, int chan, uint32_t **wbuff, uint32_t **rbuff);

int hm2_uart_setup(char *name, int bitrate, int32_t tx_mode, int32_t rx_mode);
int hm2_uart_send(char *name, unsigned char data[], int count);
int hm2_uart_read(char *name, unsigned char data[]);
int hm2_pktuart_setup(char *name, int bitrate, int32_t tx_mode, int32_t rx_mode, int txclear, int rxclear);
int hm2_pktuart_send(char *name, unsigned char data[], uint8_t *num_frames, uint16_t frame_sizes[]);
int hm2_pktuart_read(char *name, unsigned char data[], uint8_t *num_frames, uint16_t *max_frame_length,
                     uint16_t frame_sizes[]);
/* Open a port by name, unless *port is one already, and set it; *port is for hm2/serial.h. 0 or a negative number. */
int hm2_serial_use(const char *name, const struct hm2_serial_settings *settings, struct hm2_serial **port);

#endif
