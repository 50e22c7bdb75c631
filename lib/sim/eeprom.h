/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* The settings EEPROM: 64 words, a 93C46 behind the Ethernet chip (seed 000, "ETHERNET EEPROM LAYOUT"). */
#ifndef SIM_EEPROM_H
#define SIM_EEPROM_H

#include <stdbool.h>
#include <stdint.h>

#define SIM_EEPROM_WORDS           64u
#define SIM_EEPROM_PROTECTED_WORDS 16u /* the firmware guards these: recorded exchanges 69 and 70 */

struct sim_eeprom {
    uint16_t words[SIM_EEPROM_WORDS];
};

struct sim_profile;

/* name = NULL: the profile's. */
void sim_eeprom_factory(struct sim_eeprom *eeprom, const struct sim_profile *profile, const char *name,
                        const uint8_t mac[6], const uint8_t ip[4]);

#endif
