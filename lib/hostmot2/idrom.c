/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Decoding and checking of the IDROM (register map 1.2 to 1.6). Every read of the ROM is bounded by its 256 words,
 * whatever offsets and counts the image names. */
#include <hm2/idrom.h>

#include <string.h>

#include <hm2/bytes.h>

#define ROM_BYTES      (HM2_IDROM_WORDS * 4u)
#define HEADER_BYTES   0x40u
#define MD_BYTES       12u
#define PD_BYTES       4u
#define ADDRESS_SPACE  0x10000u
#define MAX_PORT_WIDTH 32u /* one bit of a register each (register map 3.1) */

/* Header words (register map 1.3), byte offsets. */
enum {
    ROM_TYPE = 0x00,
    ROM_OFFSET_MODULES = 0x04,
    ROM_OFFSET_PINS = 0x08,
    ROM_BOARD_NAME = 0x0C,
    ROM_FPGA_SIZE = 0x14,
    ROM_FPGA_PINS = 0x18,
    ROM_IO_PORTS = 0x1C,
    ROM_IO_WIDTH = 0x20,
    ROM_PORT_WIDTH = 0x24,
    ROM_CLOCK_LOW = 0x28,
    ROM_CLOCK_HIGH = 0x2C,
    ROM_INSTANCE_STRIDE = 0x30,
    ROM_REGISTER_STRIDE = 0x38,
};

struct parse {
    const struct hm2_image *image;
    const struct hm2_idrom_expect *expect;
    const char *board;
    struct hm2_idrom *out;
    struct hm2_diag *diag;
    bool bad;
};

/* One violation: the parse goes on, its result is refused. */
#define VIOLATION(parse, ...) ((parse)->bad = true, (void)hm2_diag_add((parse)->diag, HM2_ERR_MISMATCH, __VA_ARGS__))

/* Word at a byte offset; 0 behind the end of the ROM. */
static uint32_t rom_word(const struct hm2_image *const image, const uint32_t offset)
{
    return offset / 4u < HM2_IDROM_WORDS ? image->rom[offset / 4u] : 0;
}

static void put_text(char *const text, const uint32_t low, const uint32_t high)
{
    uint8_t bytes[8];
    hm2_put_le32(bytes, low);
    hm2_put_le32(bytes + 4, high);
    for (unsigned i = 0; i < 8; i++)
        text[i] = bytes[i] == 0 ? '\0' : bytes[i] < ' ' || bytes[i] > '~' ? '?' : (char)bytes[i];
    text[8] = '\0';
}

/* ---- cookie area ------------------------------------------------------------------------------------------------ */

static void check_id(struct parse *const p)
{
    static const uint8_t config_name[8] = {'H', 'O', 'S', 'T', 'M', 'O', 'T', '2'};
    const uint32_t *const id = p->image->id;
    if (id[0] != HM2_COOKIE)
        VIOLATION(p,
                  "%s: cookie (register 0x0100) is 0x%08X, expected 0x%08X; the FPGA carries no HostMot2 firmware or "
                  "its bus is broken",
                  p->board, (unsigned)id[0], HM2_COOKIE);
    if (id[1] != hm2_get_le32(config_name) || id[2] != hm2_get_le32(config_name + 4)) {
        char found[9];
        put_text(found, id[1], id[2]);
        VIOLATION(p, "%s: config name (registers 0x0104, 0x0108) is \"%s\" (0x%08X 0x%08X), expected \"HOSTMOT2\"",
                  p->board, found, (unsigned)id[1], (unsigned)id[2]);
    }
}

/* Without a possible pointer there is no ROM: its words would be anything. */
static bool check_pointer(struct parse *const p)
{
    const uint32_t pointer = p->image->id[3] & 0xFFFFu;
    const bool ok = pointer % 4u == 0 && pointer > HM2_ADDR_IDROM_POINTER && pointer <= ADDRESS_SPACE - ROM_BYTES;
    if (!ok)
        VIOLATION(p,
                  "%s: IDROM pointer (register 0x010C) is 0x%04X, expected a multiple of 4 from 0x0110 to 0xFC00 "
                  "(normally 0x0400)",
                  p->board, (unsigned)pointer);
    return ok;
}

/* ---- header ----------------------------------------------------------------------------------------------------- */

static bool offset_ok(const uint32_t offset)
{
    return offset % 4u == 0 && offset >= HEADER_BYTES && offset < ROM_BYTES;
}

static void check_offset(struct parse *const p, const char *const what, const uint32_t offset)
{
    if (!offset_ok(offset))
        VIOLATION(p, "%s: IDROM %s is %u, expected a multiple of 4 from %u to %u", p->board, what, (unsigned)offset,
                  HEADER_BYTES, ROM_BYTES - 4u);
}

static void check_ports(struct parse *const p)
{
    const struct hm2_idrom *const rom = p->out;
    if (rom->io_ports == 0)
        VIOLATION(p, "%s: IDROM IOPorts is 0, expected at least 1", p->board);
    if (rom->port_width == 0 || rom->port_width > MAX_PORT_WIDTH)
        VIOLATION(p, "%s: IDROM PortWidth is %u, expected 1 to %u", p->board, (unsigned)rom->port_width,
                  MAX_PORT_WIDTH);
    else if (hm2_connector_pin(rom->port_width, 0) == 0)
        hm2_diag_warn(p->diag, "%s: IDROM PortWidth %u is none of the known connectors'; pin names will be wrong",
                      p->board, (unsigned)rom->port_width);
    if (p->expect && p->expect->port_width && p->expect->port_width != rom->port_width)
        VIOLATION(p, "%s: IDROM PortWidth is %u, expected %u as this card has; is firmware of another card flashed?",
                  p->board, (unsigned)rom->port_width, p->expect->port_width);
    if (p->expect && p->expect->io_ports && p->expect->io_ports != rom->io_ports)
        VIOLATION(p, "%s: IDROM IOPorts is %u, expected %u as this card has; is firmware of another card flashed?",
                  p->board, (unsigned)rom->io_ports, p->expect->io_ports);
    const uint64_t product = (uint64_t)rom->io_ports * rom->port_width;
    if (product != rom->io_width)
        VIOLATION(p, "%s: IDROM IOWidth is %u, expected IOPorts * PortWidth = %u * %u = %llu", p->board,
                  (unsigned)rom->io_width, (unsigned)rom->io_ports, (unsigned)rom->port_width,
                  (unsigned long long)product);
    if (rom->io_width > HM2_MAX_PINS)
        VIOLATION(p, "%s: IDROM IOWidth is %u, expected at most %u", p->board, (unsigned)rom->io_width, HM2_MAX_PINS);
}

static void check_clock(struct parse *const p, const char *const name, const uint32_t hz)
{
    if (hz < HM2_MIN_CLOCK_HZ)
        VIOLATION(p, "%s: IDROM %s is %u Hz, expected at least %u Hz", p->board, name, (unsigned)hz, HM2_MIN_CLOCK_HZ);
}

static void parse_header(struct parse *const p)
{
    const struct hm2_image *const image = p->image;
    struct hm2_idrom *const rom = p->out;
    rom->type = rom_word(image, ROM_TYPE);
    rom->offset_modules = rom_word(image, ROM_OFFSET_MODULES);
    rom->offset_pins = rom_word(image, ROM_OFFSET_PINS);
    put_text(rom->board_name, rom_word(image, ROM_BOARD_NAME), rom_word(image, ROM_BOARD_NAME + 4));
    rom->fpga_size = rom_word(image, ROM_FPGA_SIZE);
    rom->fpga_pins = rom_word(image, ROM_FPGA_PINS);
    rom->io_ports = rom_word(image, ROM_IO_PORTS);
    rom->io_width = rom_word(image, ROM_IO_WIDTH);
    rom->port_width = rom_word(image, ROM_PORT_WIDTH);
    rom->clock_low_hz = rom_word(image, ROM_CLOCK_LOW);
    rom->clock_high_hz = rom_word(image, ROM_CLOCK_HIGH);
    for (unsigned i = 0; i < 2; i++) {
        rom->instance_stride[i] = rom_word(image, ROM_INSTANCE_STRIDE + 4u * i);
        rom->register_stride[i] = rom_word(image, ROM_REGISTER_STRIDE + 4u * i);
    }
    if (rom->type != 2 && rom->type != 3)
        VIOLATION(p, "%s: IDROM type is %u, expected 2 or 3", p->board, (unsigned)rom->type);
    check_offset(p, "OffsetToModules", rom->offset_modules);
    check_offset(p, "OffsetToPinDesc", rom->offset_pins);
    check_ports(p);
    check_clock(p, "ClockLow", rom->clock_low_hz);
    check_clock(p, "ClockHigh", rom->clock_high_hz);
}

/* ---- module descriptors ----------------------------------------------------------------------------------------- */

static void decode_module(const uint32_t word[3], struct hm2_md *const md)
{
    *md = (struct hm2_md){
        .gtag = (uint8_t)word[0],
        .version = (uint8_t)(word[0] >> 8),
        .clock_tag = (uint8_t)(word[0] >> 16),
        .instances = (uint8_t)(word[0] >> 24),
        .base = (uint16_t)word[1],
        .registers = (uint8_t)(word[1] >> 16),
        .register_stride_selector = (uint8_t)(word[1] >> 24 & 0xFu),
        .instance_stride_selector = (uint8_t)(word[1] >> 28),
        .multiple = word[2],
    };
}

static uint32_t check_stride(struct parse *const p, const unsigned number, const struct hm2_md *const md,
                             const char *const kind, const unsigned selector, const uint32_t strides[2])
{
    if (selector > 1) {
        VIOLATION(p, "%s: module descriptor %u (%s): %s stride selector is %u, expected 0 or 1", p->board, number,
                  hm2_tag_name(md->gtag), kind, selector);
        return 0;
    }
    const uint32_t stride = strides[selector];
    if (stride == 0 || stride % 4u != 0 || stride >= ADDRESS_SPACE)
        VIOLATION(p,
                  "%s: module descriptor %u (%s): IDROM %s stride %u is %u bytes, expected a multiple of 4 from 4 to "
                  "65532",
                  p->board, number, hm2_tag_name(md->gtag), kind, selector, (unsigned)stride);
    return stride;
}

/* The last register of the last instance must still be inside the 64 KiB of register space. */
static void check_range(struct parse *const p, const unsigned number, const struct hm2_md *const md)
{
    const uint64_t registers = md->registers ? md->registers - 1u : 0;
    const uint64_t instances = md->instances && md->multiple ? md->instances - 1u : 0;
    const uint64_t last = md->base + registers * md->register_stride + instances * md->instance_stride;
    if (md->base % 4u != 0 || last + 4u > ADDRESS_SPACE)
        VIOLATION(p,
                  "%s: module descriptor %u (%s): base address 0x%04X with %u registers of %u instances ends at "
                  "0x%llX, expected a multiple of 4 with all registers below 0x10000",
                  p->board, number, hm2_tag_name(md->gtag), md->base, md->registers, md->instances,
                  (unsigned long long)(last + 3u));
}

/* Public firmware exists that contradicts itself here; ports of which either knows nothing are not used. */
static void check_port_count(struct parse *const p, const unsigned number, const struct hm2_md *const md)
{
    const unsigned ports = p->out->io_ports;
    if (md->instances == 0)
        VIOLATION(p, "%s: module descriptor %u (IOPort): instances is 0, expected IOPorts of the header, %u", p->board,
                  number, ports);
    else if (md->instances != ports)
        hm2_diag_warn(p->diag,
                      "%s: module descriptor %u (IOPort): instances is %u, expected IOPorts of the header, %u; the "
                      "first %u are used",
                      p->board, number, md->instances, ports, md->instances < ports ? md->instances : ports);
}

static void check_module(struct parse *const p, const unsigned number, struct hm2_md *const md)
{
    const struct hm2_idrom *const rom = p->out;
    if (md->clock_tag != 1 && md->clock_tag != 2)
        VIOLATION(p, "%s: module descriptor %u (%s): clock tag is %u, expected 1 (ClockLow) or 2 (ClockHigh)", p->board,
                  number, hm2_tag_name(md->gtag), md->clock_tag);
    else
        md->clock_hz = md->clock_tag == 1 ? rom->clock_low_hz : rom->clock_high_hz;
    md->register_stride = check_stride(p, number, md, "register", md->register_stride_selector, rom->register_stride);
    md->instance_stride = check_stride(p, number, md, "instance", md->instance_stride_selector, rom->instance_stride);
    check_range(p, number, md);
    if (md->gtag == HM2_GTAG_IOPORT)
        check_port_count(p, number, md);
}

/* Types a card can have only once: everything that has a driver in LinuxCNC (register map 1.6, check 16). */
static bool is_singular(const uint8_t gtag)
{
    static const uint8_t singular[] = {
        HM2_GTAG_WATCHDOG, HM2_GTAG_IOPORT,     HM2_GTAG_ENCODER,       HM2_GTAG_STEPGEN,  HM2_GTAG_PWMGEN,
        HM2_GTAG_SSI,      HM2_GTAG_UART_TX,    HM2_GTAG_UART_RX,       HM2_GTAG_BSPI,     HM2_GTAG_TPPWM,
        HM2_GTAG_BISS,     HM2_GTAG_FABS,       HM2_GTAG_DPLL,          HM2_GTAG_INMUX,    HM2_GTAG_INM,
        HM2_GTAG_XY2MOD,   HM2_GTAG_RCPWM,      HM2_GTAG_OUTM,          HM2_GTAG_LED,      HM2_GTAG_SSR,
        HM2_GTAG_SSERIAL,  HM2_GTAG_ONESHOT,    HM2_GTAG_PERIODM,       HM2_GTAG_RESOLVER, HM2_GTAG_PKTUART_TX,
        HM2_GTAG_SSERIALB, HM2_GTAG_PKTUART_RX, HM2_GTAG_MUXED_ENCODER,
    };
    return memchr(singular, gtag, sizeof singular) != NULL;
}

static void check_duplicate(struct parse *const p, const unsigned number)
{
    const struct hm2_md *const modules = p->out->modules;
    const uint8_t gtag = modules[number].gtag;
    if (!is_singular(gtag))
        return;
    for (unsigned i = 0; i < number; i++) {
        if (modules[i].gtag != gtag)
            continue;
        VIOLATION(p,
                  "%s: module descriptor %u: tag 0x%02X (%s) found again, expected only once (it is descriptor %u "
                  "already); the firmware is inconsistent",
                  p->board, number, gtag, hm2_tag_name(gtag), i);
        return;
    }
}

/* The list ends with tag 0, at the pin list, at the end of the ROM or after 48 entries (register map 1.4). */
static void parse_modules(struct parse *const p)
{
    struct hm2_idrom *const rom = p->out;
    const uint32_t end =
        rom->offset_pins > rom->offset_modules && rom->offset_pins < ROM_BYTES ? rom->offset_pins : ROM_BYTES;
    uint32_t at = rom->offset_modules;
    for (; at < end && end - at >= MD_BYTES; at += MD_BYTES) {
        const uint32_t words[3] = {rom_word(p->image, at), rom_word(p->image, at + 4), rom_word(p->image, at + 8)};
        if ((words[0] & 0xFFu) == HM2_GTAG_NONE)
            break;
        if (rom->module_count == HM2_MAX_MODULES) {
            VIOLATION(p, "%s: the list of module descriptors has no end (tag 0) after %u entries, expected at most %u",
                      p->board, HM2_MAX_MODULES, HM2_MAX_MODULES);
            break;
        }
        const unsigned number = rom->module_count++;
        decode_module(words, rom->modules + number);
        check_module(p, number, rom->modules + number);
        check_duplicate(p, number);
    }
    if (!hm2_idrom_find(rom, HM2_GTAG_IOPORT))
        VIOLATION(p, "%s: no IOPort module descriptor (tag 0x03) found among %u, expected one with %u instances",
                  p->board, rom->module_count, (unsigned)rom->io_ports);
}

/* ---- pin descriptors -------------------------------------------------------------------------------------------- */

static void decode_pin(const uint32_t word, struct hm2_pd *const pd)
{
    *pd = (struct hm2_pd){
        .secondary_pin = (uint8_t)word,
        .secondary_tag = (uint8_t)(word >> 8),
        .secondary_unit = (uint8_t)(word >> 16),
        .primary_tag = (uint8_t)(word >> 24),
    };
}

/* Neighbours with the same wrong primary tag are one violation, so that a short list is one sentence. */
static void check_pins(struct parse *const p)
{
    const struct hm2_idrom *const rom = p->out;
    const unsigned ports = hm2_idrom_ports(rom);
    const uint64_t usable = (uint64_t)ports * rom->port_width;
    const unsigned count = ports < rom->io_ports && usable < rom->pin_count ? (unsigned)usable : rom->pin_count;
    for (unsigned first = 0; first < count;) {
        const uint8_t tag = rom->pins[first].primary_tag;
        unsigned last = first;
        while (last + 1 < count && rom->pins[last + 1].primary_tag == tag)
            last++;
        if (tag != HM2_GTAG_IOPORT)
            VIOLATION(p, "%s: pin descriptors %u to %u: primary tag is 0x%02X%s, expected 0x03 (IOPort) in all %u",
                      p->board, first, last, tag, tag == 0 ? " (the list is too short)" : "", count);
        first = last + 1;
    }
}

static void parse_pins(struct parse *const p)
{
    struct hm2_idrom *const rom = p->out;
    const unsigned wanted = rom->io_width < HM2_MAX_PINS ? rom->io_width : HM2_MAX_PINS;
    const uint32_t room = (ROM_BYTES - rom->offset_pins) / PD_BYTES;
    rom->pin_count = wanted < room ? wanted : room;
    if (wanted > room)
        VIOLATION(p,
                  "%s: the list of pin descriptors at offset %u has room for %u before the ROM ends, expected %u "
                  "(IOWidth)",
                  p->board, (unsigned)rom->offset_pins, (unsigned)room, (unsigned)rom->io_width);
    for (unsigned i = 0; i < rom->pin_count; i++)
        decode_pin(rom_word(p->image, rom->offset_pins + i * PD_BYTES), rom->pins + i);
    check_pins(p);
}

/* ---- whole image ------------------------------------------------------------------------------------------------ */

/* FNV-1a, 64 bit, over the little-endian bytes. */
static uint64_t fnv1a(uint64_t hash, const uint32_t *const words, const size_t count)
{
    for (size_t i = 0; i < count; i++)
        for (unsigned shift = 0; shift < 32; shift += 8)
            hash = (hash ^ (words[i] >> shift & 0xFFu)) * 0x100000001B3u;
    return hash;
}

uint64_t hm2_image_fingerprint(const struct hm2_image *const image)
{
    const uint64_t hash = fnv1a(0xCBF29CE484222325u, image->id, sizeof image->id / sizeof image->id[0]);
    return fnv1a(hash, image->rom, HM2_IDROM_WORDS);
}

int hm2_idrom_parse(const struct hm2_image *const image, const struct hm2_idrom_expect *const expect,
                    struct hm2_idrom *const out, struct hm2_diag *const diag)
{
    struct parse p = {
        .image = image,
        .expect = expect,
        .board = expect && expect->board ? expect->board : "this card",
        .out = out,
        .diag = diag,
    };
    memset(out, 0, sizeof *out);
    out->fingerprint = hm2_image_fingerprint(image);
    check_id(&p);
    if (check_pointer(&p)) {
        parse_header(&p);
        if (offset_ok(out->offset_modules))
            parse_modules(&p);
        if (offset_ok(out->offset_pins))
            parse_pins(&p);
    }
    return p.bad ? HM2_ERR_MISMATCH : 0;
}

const struct hm2_md *hm2_idrom_find(const struct hm2_idrom *const idrom, const uint8_t gtag)
{
    for (unsigned i = 0; i < idrom->module_count && i < HM2_MAX_MODULES; i++)
        if (idrom->modules[i].gtag == gtag)
            return idrom->modules + i;
    return NULL;
}

unsigned hm2_idrom_ports(const struct hm2_idrom *const idrom)
{
    const struct hm2_md *const md = hm2_idrom_find(idrom, HM2_GTAG_IOPORT);
    return md && md->instances > 0 && md->instances < idrom->io_ports ? md->instances : idrom->io_ports;
}
