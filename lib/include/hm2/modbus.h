/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Modbus maps: which registers and coils of which devices become which pins, and the conversions between the two.
 *
 * The file is the INI file of LinuxCNC's mb2hal (its manual page and the comments of its sample file are the
 * specification; names of pins as LinuxCNC 2.9's program makes them), and more: types, word order, scale, write on
 * change, initial values; modbus_io(9) lists all keys. Nothing here moves a byte. Limits of a transaction are those of
 * the MODBUS Application Protocol Specification V1.1b3, chapter 6.
 */
#ifndef HM2_MODBUS_H
#define HM2_MODBUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

#define HM2_MODBUS_NAME_SIZE  48u /* a name of a pin, transaction or component, with its end; HAL allows as many */
#define HM2_MODBUS_MAX_COILS  2000u
#define HM2_MODBUS_FILE_BYTES (1u << 20) /* a longer file is refused */

/* The function codes of the protocol. */
enum hm2_modbus_function {
    HM2_MODBUS_READ_COILS = 1,
    HM2_MODBUS_READ_DISCRETE_INPUTS = 2,
    HM2_MODBUS_READ_HOLDING_REGISTERS = 3,
    HM2_MODBUS_READ_INPUT_REGISTERS = 4,
    HM2_MODBUS_WRITE_SINGLE_COIL = 5,
    HM2_MODBUS_WRITE_SINGLE_REGISTER = 6,
    HM2_MODBUS_WRITE_MULTIPLE_COILS = 15,
    HM2_MODBUS_WRITE_MULTIPLE_REGISTERS = 16,
};

enum hm2_modbus_type {
    HM2_MODBUS_COIL,
    HM2_MODBUS_REGISTER, /* as mb2hal: read 0 to 65535, written -32768 to 65535 */
    HM2_MODBUS_U16,
    HM2_MODBUS_S16,
    HM2_MODBUS_U32,
    HM2_MODBUS_S32,
    HM2_MODBUS_F32,
    HM2_MODBUS_BITS, /* 16 bits of a register, each with a pin of its own */
};

struct hm2_modbus_element {
    char name[HM2_MODBUS_NAME_SIZE];
    enum hm2_modbus_type type;
    unsigned word;        /* its first word in the transaction; coils take one each */
    double scale, offset; /* pin = number in the device * scale + offset; scale is finite and not 0 */
    double initial;       /* of the pin of an element that is written */
};

enum hm2_modbus_rts { HM2_MODBUS_RTS_NONE, HM2_MODBUS_RTS_UP, HM2_MODBUS_RTS_DOWN };

struct hm2_modbus_link {
    bool tcp;
    char host[64]; /* IPv4 address or name */
    unsigned port;
    char device[128]; /* serial port or terminal */
    unsigned baud, data_bits, stop_bits;
    char parity; /* 'N', 'E', 'O' */
    bool rs485;  /* ask the serial port's driver for RS-485 */
    enum hm2_modbus_rts rts;
};

struct hm2_modbus_transaction {
    char name[HM2_MODBUS_NAME_SIZE]; /* HAL_TX_NAME, or the number of the transaction */
    unsigned link;                   /* index in the map */
    enum hm2_modbus_function function;
    unsigned unit, first;
    unsigned words; /* coils or registers that it moves */
    unsigned element_count;
    struct hm2_modbus_element *elements;
    bool low_word_first; /* of 32-bit numbers */
    double rate_hz;      /* at most; 0 = as often as the link allows */
    unsigned response_timeout_ms, byte_timeout_ms;
    unsigned delay_ms; /* pause on a serial link afterwards */
    unsigned retries;
    bool on_change;   /* write when a value differs from what the device has confirmed */
    double refresh_s; /* with on_change, and after so long; 0 = never */
    bool enable_pin;
};

struct hm2_modbus_map {
    char component[HM2_MODBUS_NAME_SIZE];
    bool short_names; /* VERSION 1.0: bits, and what is written, have no type behind the name and no second pin */
    double slowdown_s;
    unsigned link_count, transaction_count;
    struct hm2_modbus_link *links;
    struct hm2_modbus_transaction *transactions;
};

/* Read a file's text. 0, with *map for hm2_modbus_free(), perhaps with warnings in diag; or a negative hm2_err with all
 * problems as "FILE:LINE: sentence". diag may be NULL. Allocates; not realtime safe. */
HM2_API int HM2_MUST_CHECK hm2_modbus_parse(const char *text, size_t length, const char *file_name,
                                            struct hm2_modbus_map **map, struct hm2_diag *diag);
HM2_API void hm2_modbus_free(struct hm2_modbus_map *map);

HM2_API bool hm2_modbus_writes(enum hm2_modbus_function function);
/* Coils and discrete inputs. */
HM2_API bool hm2_modbus_is_bits(enum hm2_modbus_function function);

/* The number of an element in the words of its transaction, scaled, and as it is in the device (a fraction cut off,
 * outside of 32 bits the nearest limit). Coils: 0 or 1. Not for bits. Realtime safe. */
HM2_API double hm2_modbus_decode(const struct hm2_modbus_element *element, bool low_word_first, const uint16_t *words);
HM2_API int32_t hm2_modbus_decode_int(const struct hm2_modbus_element *element, bool low_word_first,
                                      const uint16_t *words);
/* The reverse: number is unscaled, whole is added as it is. A number outside the type's range becomes the nearest
 * limit, NaN 0. Of a plain HM2_MODBUS_REGISTER a fraction is cut off, as mb2hal does; else it is rounded. Realtime
 * safe. */
HM2_API void hm2_modbus_encode(const struct hm2_modbus_element *element, bool low_word_first, double number,
                               int32_t whole, uint16_t *words);

#endif
