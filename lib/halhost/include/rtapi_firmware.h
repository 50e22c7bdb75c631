/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Firmware files for cards that have none of their own. No such card is supported here: requests find nothing. */
#ifndef RTAPI_FIRMWARE_H
#define RTAPI_FIRMWARE_H

#include <stddef.h>

#include <rtapi.h>

struct rtapi_device;

struct rtapi_firmware {
    size_t size;
    const unsigned char *data;
};

RTAPI_BEGIN_DECLS

int rtapi_request_firmware(const struct rtapi_firmware **firmware, const char *name, struct rtapi_device *device);
void rtapi_release_firmware(const struct rtapi_firmware *firmware);

RTAPI_END_DECLS

#endif
