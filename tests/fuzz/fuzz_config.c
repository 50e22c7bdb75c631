/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Any string as config=: accepted values are in range, refused ones have a sentence. */
#include <stdlib.h>
#include <string.h>

#include <hm2/config.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    char *const text = malloc(size + 1);
    if (!text)
        return 0;
    memcpy(text, data, size);
    text[size] = '\0';
    struct hm2_config config;
    struct hm2_diag diag = {0};
    const int result = hm2_config_parse(text, &config, &diag);
    free(text);
    if ((result == 0) != (diag.problems == 0) || config.stepgen_width < 1 || config.stepgen_width > 8)
        abort();
    for (unsigned i = 0; i < HM2_CFG_COUNTS; i++)
        if (config.count[i] < HM2_CFG_ALL)
            abort();
    if (hm2_config_sserial_ports(&config, 4) > 4)
        abort();
    return 0;
}
