/* SPDX-License-Identifier: GPL-2.0-or-later */
/* Any text as a Modbus map: what is accepted keeps the protocol's limits, and its words convert. */
#include <stdlib.h>
#include <string.h>

#include <hm2/modbus.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void convert(const struct hm2_modbus_transaction *const tx, const uint8_t *const data, const size_t size)
{
    uint16_t words[HM2_MODBUS_MAX_COILS] = {0};
    memcpy(words, data, size < sizeof words ? size : sizeof words);
    for (unsigned i = 0; i < tx->element_count; i++) {
        const struct hm2_modbus_element *const element = &tx->elements[i];
        if (element->word >= tx->words)
            abort();
        const double number = hm2_modbus_decode(element, tx->low_word_first, words);
        (void)hm2_modbus_decode_int(element, tx->low_word_first, words);
        hm2_modbus_encode(element, tx->low_word_first, number, (int32_t)size, words);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *const data, const size_t size)
{
    struct hm2_modbus_map *map;
    struct hm2_diag diag = {0};
    const int err = hm2_modbus_parse((const char *)data, size, "map.ini", &map, &diag);
    if ((err == 0) != (diag.problems == 0) || (err == 0) != (map != NULL))
        abort();
    for (unsigned i = 0; map && i < map->transaction_count; i++) {
        const struct hm2_modbus_transaction *const tx = &map->transactions[i];
        if (tx->link >= map->link_count || tx->words == 0 || tx->words > HM2_MODBUS_MAX_COILS ||
            tx->first + tx->words > 65536 || tx->unit > 255)
            abort();
        convert(tx, data, size);
    }
    hm2_modbus_free(map);
    return 0;
}
