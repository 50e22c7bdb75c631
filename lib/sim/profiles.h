/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Cards that can be simulated: what tells one from the other. */
#ifndef SIM_PROFILES_H
#define SIM_PROFILES_H

#include <hm2/idrom.h>
#include <hm2/sim.h>

struct sim_module_row {
    uint8_t gtag, version, clock_tag, instances;
    uint16_t base;
    uint8_t registers, strides;
    uint32_t multiple;
};

struct sim_pin_row {
    uint8_t tag, unit, pin;
};

struct sim_firmware {
    const char *board_name; /* 8 characters */
    uint32_t fpga_size, fpga_pins;
    uint32_t io_ports, port_width;
    uint32_t clock_low_hz, clock_high_hz;
    const struct sim_module_row *modules;
    unsigned module_count;
    const struct sim_pin_row *pins; /* pins behind the last row carry no secondary function */
    unsigned pin_count;
    const uint32_t *local_pins; /* descriptors behind the last pin: local I/O (register map 1.5) */
    unsigned local_pin_count;
};

#define SIM_IDCODE_SLX16 0x04002093u
#define SIM_IDCODE_SLX25 0x04004093u

struct sim_profile {
    const char *name;
    const char *card_name;                  /* EEPROM and space 7 */
    bool efinix;                            /* undriven bus reads zeros, no boot block; else Xilinx */
    uint16_t lbp_version, firmware_version; /* space 7 (seed 000, "SPACE 7") */
    uint8_t ip[4];                          /* that the card uses as its jumpers say */
    uint8_t eeprom_ip[4];
    unsigned eeprom_mac_word; /* where the MAC address starts: 1 by the manual, 0 on the recorded card */
    uint8_t flash_id;
    const char *part; /* FPGA, as image files name it, and as it names itself (Xilinx) */
    uint32_t idcode;
    const struct sim_firmware *firmware;
};

const struct sim_profile *sim_profile_find(const char *name);
/* All names, with blanks between them, for messages. */
void sim_profile_list(char *text, size_t size);
extern const struct sim_firmware sim_firmware_7i93_svst4_8, sim_firmware_7i93_svst8_8im2, sim_firmware_7i93_svst8_4im2,
    sim_firmware_7i93_svst1_4_7i47s, sim_firmware_7i93_2x7i65, sim_firmware_7i93_sv12im_2x7i48,
    sim_firmware_7i93_sv6_7i49;
void sim_profile_image(const struct sim_profile *profile, struct hm2_image *image);

#endif
