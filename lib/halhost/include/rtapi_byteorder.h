/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Byte order as preprocessor constants that are 0 or 1. */
#ifndef RTAPI_BYTEORDER_H
#define RTAPI_BYTEORDER_H

#define RTAPI_BIG_ENDIAN       (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__)
#define RTAPI_LITTLE_ENDIAN    (__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__)
#define RTAPI_FLOAT_BIG_ENDIAN (__FLOAT_WORD_ORDER__ == __ORDER_BIG_ENDIAN__)

#endif
