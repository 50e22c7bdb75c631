/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "eeprom.h"

#include <string.h>

#include "profiles.h"
#include <hm2/lbp16.h>

static uint16_t big_endian(const uint8_t *const p)
{
    return (uint16_t)(p[0] << 8 | p[1]);
}

void sim_eeprom_factory(struct sim_eeprom *const eeprom, const struct sim_profile *const profile,
                        const char *const name, const uint8_t mac[6], const uint8_t ip[4])
{
    const char *const own = name ? name : profile->card_name;
    memset(eeprom, 0, sizeof *eeprom);
    uint16_t *const w = eeprom->words;
    for (unsigned i = 0; i < 3; i++)
        w[profile->eeprom_mac_word + i] = big_endian(mac + 4 - 2 * i);
    for (unsigned i = 0; i < LBP16_INFO_NAME_BYTES && own[i]; i++)
        w[LBP16_EEPROM_NAME / 2 + i / 2] |= (uint16_t)((uint8_t)own[i] << (8 * (i % 2)));
    w[LBP16_EEPROM_IP / 2] = big_endian(ip + 2);
    w[LBP16_EEPROM_IP / 2 + 1] = big_endian(ip);
}
