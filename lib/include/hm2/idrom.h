/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The HostMot2 IDROM: what a firmware image says it contains (reference: hostmot2 register map, sections 1.2 to 1.6).
 *
 * Pure decoding from the caller's bytes; no function here allocates or makes a system call. Parsing formats
 * diagnostics and is therefore for set-up time, not for a realtime thread. A struct hm2_idrom is about 3 KiB.
 */
#ifndef HM2_IDROM_H
#define HM2_IDROM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

#define HM2_ADDR_COOKIE        0x0100u /* R  0x55AACAFE */
#define HM2_ADDR_CONFIG_NAME   0x0104u /* R  "HOSTMOT2", 8 bytes */
#define HM2_ADDR_IDROM_POINTER 0x010Cu /* R  [15:0] byte address of the IDROM, normally 0x0400 */
#define HM2_COOKIE             0x55AACAFEu
#define HM2_IDROM_WORDS        256u /* the ROM is decoded as one KiB (1.2) */
#define HM2_MAX_MODULES        48u  /* the driver's limit; a type 3 ROM holds 32 */
#define HM2_MAX_PINS           144u /* 0x1C0 + 144 * 4 = 0x400, the end of the ROM (1.3) */
#define HM2_MIN_CLOCK_HZ       1000000u

/* Module tags (2.1). Only those that code here refers to by name; the full list with names is in hm2_tag_name(). */
enum hm2_gtag {
    HM2_GTAG_NONE = 0x00,
    HM2_GTAG_IRQ = 0x01,
    HM2_GTAG_WATCHDOG = 0x02,
    HM2_GTAG_IOPORT = 0x03,
    HM2_GTAG_ENCODER = 0x04,
    HM2_GTAG_STEPGEN = 0x05,
    HM2_GTAG_PWMGEN = 0x06,
    HM2_GTAG_SPI = 0x07,
    HM2_GTAG_SSI = 0x08,
    HM2_GTAG_UART_TX = 0x09,
    HM2_GTAG_UART_RX = 0x0A,
    HM2_GTAG_TRAM = 0x0B,
    HM2_GTAG_MUXED_ENCODER = 0x0C,
    HM2_GTAG_MUXED_ENCODER_SEL = 0x0D,
    HM2_GTAG_BSPI = 0x0E,
    HM2_GTAG_DBSPI = 0x0F,
    HM2_GTAG_OLD_DPLL = 0x10,
    HM2_GTAG_TPPWM = 0x13,
    HM2_GTAG_WAVEGEN = 0x14,
    HM2_GTAG_BISS = 0x18,
    HM2_GTAG_FABS = 0x19,
    HM2_GTAG_DPLL = 0x1A,
    HM2_GTAG_PKTUART_TX = 0x1B,
    HM2_GTAG_PKTUART_RX = 0x1C,
    HM2_GTAG_INMUX = 0x1E,
    HM2_GTAG_INM = 0x23,
    HM2_GTAG_XY2MOD = 0x2B,
    HM2_GTAG_RCPWM = 0x2C,
    HM2_GTAG_OUTM = 0x2D,
    HM2_GTAG_LIOPORT = 0x40,
    HM2_GTAG_LED = 0x80,
    HM2_GTAG_RESOLVER = 0xC0,
    HM2_GTAG_SSERIAL = 0xC1,
    HM2_GTAG_SSR = 0xC3,
    HM2_GTAG_SSERIALB = 0xC6,
    HM2_GTAG_ONESHOT = 0xC7,
    HM2_GTAG_PERIODM = 0xC8,
};

/* Pin descriptor fields (1.5). */
#define HM2_PIN_OUTPUT  0x80u /* secondary pin bit 7: from the FPGA to the connector */
#define HM2_UNIT_GLOBAL 0x80u /* secondary unit: shared by all instances */

/* The bytes of a card that matter, as read from it or from a file. */
struct hm2_image {
    uint32_t id[4];                /* registers 0x0100..0x010C */
    uint32_t rom[HM2_IDROM_WORDS]; /* from the address that id[3] gives */
};

/* Module descriptor (1.4). */
struct hm2_md {
    uint8_t gtag, version, clock_tag, instances;
    uint16_t base;
    uint8_t registers; /* declared; some modules have more */
    uint8_t register_stride_selector, instance_stride_selector;
    uint32_t multiple; /* bit r = register r exists per instance */
    /* derived */
    uint32_t clock_hz;
    uint32_t register_stride, instance_stride;
};

/* Pin descriptor (1.5). */
struct hm2_pd {
    uint8_t secondary_pin, secondary_tag, secondary_unit, primary_tag;
};

struct hm2_idrom {
    uint32_t type;
    uint32_t offset_modules, offset_pins;
    char board_name[9];
    uint32_t fpga_size, fpga_pins;
    uint32_t io_ports, io_width, port_width;
    uint32_t clock_low_hz, clock_high_hz;
    uint32_t instance_stride[2], register_stride[2];
    unsigned module_count;
    struct hm2_md modules[HM2_MAX_MODULES];
    unsigned pin_count; /* == io_width */
    struct hm2_pd pins[HM2_MAX_PINS];
    uint64_t fingerprint; /* FNV-1a over id[] and rom[]: tells one firmware from another */
};

/* What the card's name promises about its connectors; 0 = unknown, not compared. */
struct hm2_idrom_expect {
    const char *board; /* for messages; NULL = "this card" */
    unsigned io_ports, port_width;
};

/*
 * Decode and check an image (all checks of section 1.6 and hal-interface 1.4). Every violation found is reported in
 * diag, each as one sentence with field, value found and value expected; the parse goes on as far as it is safe.
 * Returns 0, or HM2_ERR_MISMATCH when anything was wrong: out then holds what could be decoded, all counts within their
 * limits, good for a report but not for driving the card. expect may be NULL. Whether a module's version, register
 * count, stride and mask suit its driver is checked when the card is set up (hal-interface 1.5), not here.
 */
HM2_API int HM2_MUST_CHECK hm2_idrom_parse(const struct hm2_image *image, const struct hm2_idrom_expect *expect,
                                           struct hm2_idrom *out, struct hm2_diag *diag);

/* Read an image in the text format of the firmware dumps ("AAAA VVVVVVVV" hex per line, "#" comments; words of the
 * ROM that are not listed are 0). HM2_ERR_MALFORMED with the line number in diag. */
HM2_API int HM2_MUST_CHECK hm2_image_from_text(const char *text, size_t len, struct hm2_image *image,
                                               struct hm2_diag *diag);

/* FNV-1a, 64 bit, over id[] and rom[] as bytes in little-endian order. Realtime safe. */
HM2_API uint64_t hm2_image_fingerprint(const struct hm2_image *image);

/* First module with this tag, NULL when there is none. */
HM2_API const struct hm2_md *hm2_idrom_find(const struct hm2_idrom *idrom, uint8_t gtag);

/* Ports that can be used: the header's, or the IOPort module's where it has fewer (a warning of the parse). */
HM2_API unsigned hm2_idrom_ports(const struct hm2_idrom *idrom);

/* Byte address of register reg of an instance (1.4). No check of the arguments against the descriptor. */
static inline uint16_t hm2_md_address(const struct hm2_md *const md, const unsigned reg, const unsigned instance)
{
    const uint32_t step = reg < 32 && (md->multiple >> reg & 1u) ? instance * md->instance_stride : 0;
    return (uint16_t)(md->base + reg * md->register_stride + step);
}

/* Name of a module type as messages and listings print it ("StepGen"); "unknown" for an unlisted tag. */
HM2_API const char *hm2_tag_name(uint8_t gtag);
/* Text of a pin's secondary function as LinuxCNC's listing prints it ("Step", "Muxed A", "GPIO" without one); buf
 * receives generated names ("tx3", "unknown-pin-9"). Returns buf or a constant string. */
HM2_API const char *hm2_pin_function(const struct hm2_pd *pd, char *buf, size_t size);
/* Number of the connector pin that carries I/O number io on a card with this port width (1.7): odd pins of a 50-pin
 * header, DB25 order, or I/O number + 1. 0 = no connector of this width is known. */
HM2_API unsigned hm2_connector_pin(uint32_t port_width, unsigned io);

#endif
