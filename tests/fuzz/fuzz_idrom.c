/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Firmware images as raw words (first byte even) or as text (odd): whatever they hold, nothing is read outside. */
#include <stdlib.h>
#include <string.h>

#include <hm2/idrom.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void use(const struct hm2_image *const image, const struct hm2_idrom_expect *const expect)
{
    struct hm2_idrom rom;
    struct hm2_diag diag = {0};
    const int result = hm2_idrom_parse(image, expect, &rom, &diag);
    if ((result == 0) != (diag.problems == 0) || rom.module_count > HM2_MAX_MODULES || rom.pin_count > HM2_MAX_PINS)
        abort();
    if (result == 0 && rom.pin_count != rom.io_ports * rom.port_width)
        abort();
    char name[32];
    for (unsigned i = 0; i < rom.pin_count; i++)
        if (!hm2_pin_function(rom.pins + i, name, sizeof name))
            abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    struct hm2_image image = {0};
    if (size == 0)
        return 0;
    if (data[0] & 1) {
        struct hm2_diag diag = {0};
        if (hm2_image_from_text((const char *)data + 1, size - 1, &image, &diag) != 0)
            return 0;
    } else {
        memcpy(&image, data + 1, size - 1 < sizeof image ? size - 1 : sizeof image);
    }
    use(&image, NULL);
    use(&image, &(struct hm2_idrom_expect){"7I96S", 3, 17});
    return 0;
}
