/* SPDX-License-Identifier: GPL-2.0-or-later */
#include "instance.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <rtapi.h>

#include "common/messenger.h"

static char *read_file(const char *const path, size_t *const length)
{
    FILE *const file = fopen(path, "re");
    char *text = file ? malloc(HM2_MODBUS_FILE_BYTES + 1u) : NULL;
    if (text)
        *length = fread(text, 1, HM2_MODBUS_FILE_BYTES + 1u, file);
    if (!text || ferror(file)) {
        rtapi_print_msg(RTAPI_MSG_ERR, "modbus_io: %s: cannot be read: %s\n", path, strerror(errno));
        free(text);
        text = NULL;
    }
    if (file)
        (void)fclose(file);
    return text;
}

int instance_read(struct instance *const instance, const char *const path)
{
    struct hm2_diag diag;
    size_t length;
    *instance = (struct instance){0};
    char *const text = read_file(path, &length);
    if (!text)
        return -EINVAL;
    hm2_diag_clear(&diag);
    const int err = hm2_modbus_parse(text, length, path, &instance->map, &diag);
    messenger_print_diag("modbus_io", path, &diag);
    free(text);
    return err ? -EINVAL : 0;
}

static int make(struct instance *const instance, struct hm2_binder *const binder, struct hm2_diag *const diag)
{
    instance->engine = engine_new(instance->map);
    if (!instance->engine) {
        (void)hm2_diag_add(diag, HM2_ERR_NOMEM, "no memory, or a setting that the serial port cannot have");
        return -ENOMEM;
    }
    instance->pins = pins_new(binder, instance->map, instance->engine, diag);
    return instance->pins ? 0 : -EINVAL;
}

int instance_make(struct instance *const instance, const char *const path, struct hm2_binder *const binder)
{
    struct hm2_diag diag;
    hm2_diag_clear(&diag);
    const int result = make(instance, binder, &diag);
    messenger_print_diag("modbus_io", path, &diag);
    return result;
}

void instance_free(struct instance *const instance)
{
    engine_free(instance->engine);
    hm2_modbus_free(instance->map);
}
