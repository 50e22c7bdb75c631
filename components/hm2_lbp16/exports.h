/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Functions for other components; main.c exports them. */
#ifndef HM2_LBP16_EXPORTS_H
#define HM2_LBP16_EXPORTS_H

#include <stdint.h>

int hm2_bspi_setup_chan(char *name, int chan, int cs, int bits, double mhz, int delay, int cpol, int cpha, int noclear,
                        int noecho, int samplelate);
int hm2_bspi_set_read_function(char *name, int (*func)(void *subdata), void *subdata);
int hm2_bspi_set_write_function(char *name, int (*func)(void *subdata), void *subdata);
int hm2_bspi_write_chan(char *name, int chan, uint32_t val);
int hm2_allocate_bspi_tram(char *name);
int hm2_bspi_clear_fifo(char *name);
int hm2_tram_add_bspi_frame(char *name, int chan, uint32_t **wbuff, uint32_t **rbuff);

#endif
