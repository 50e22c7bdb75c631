/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Tables of contents and records of a remote (seed 003, "PROCESS DATA DISCOVERY"; hal-interface 4.4). A remote may
 * claim anything: tables and texts end at their limits, and no number is used before it was checked.
 */
#include <string.h>

#include <hm2/number.h>
#include <hm2/sslbp.h>

#define RECORD_PROCESS 0xA0u
#define RECORD_MODE    0xB0u
#define TOC_MAX        256u
#define NAME_CHARS     (SSLBP_TEXT_SIZE - 1u)
#define WIDEST         64u

enum { AT_TYPE = 0, AT_MIN = 4, AT_MAX = 8, AT_ADDRESS = 12, AT_TEXT = 14, AT_MODE_NAME = 4 };

struct reader {
    const struct sslbp_memory *memory;
    const char *name;
    unsigned user_bits;
    struct sslbp_tables *tables;
    struct hm2_diag *diag;
    bool as_written; /* texts for people, not for HAL */
};

static int get(const struct reader *const reader, const uint16_t address, const unsigned bytes, uint32_t *const value)
{
    return reader->memory->read(reader->memory->access, address, bytes, value);
}

/* A character that a HAL file can carry. */
static char fit(const unsigned char c)
{
    if (c >= 'A' && c <= 'Z')
        return (char)(c + ('a' - 'A'));
    return (char)(c <= ' ' || c > '~' || strchr("#\"'\\$=<>[](),", c) ? '-' : c);
}

/* A text ended by 0, read four bytes at a time. *at moves behind it. */
static int get_text(const struct reader *const reader, uint16_t *const at, char text[SSLBP_TEXT_SIZE])
{
    uint32_t word = 0;
    memset(text, 0, SSLBP_TEXT_SIZE);
    for (unsigned i = 0; i <= NAME_CHARS; i++) {
        const int err = i % 4u ? 0 : get(reader, (uint16_t)(*at + i), 4, &word);
        if (err < 0)
            return err;
        const unsigned char c = (unsigned char)(word >> 8u * (i % 4u));
        if (c == 0 || i == NAME_CHARS) {
            *at = (uint16_t)(*at + i + 1u);
            break;
        }
        text[i] = !reader->as_written ? fit(c) : c < ' ' || c > '~' ? '?' : (char)c;
    }
    return 0;
}

static double get_single(const uint32_t word)
{
    return hm2_finite_or(sslbp_from_float(word, 32), 0.0);
}

static int get_field(const struct reader *const reader, const uint16_t at, struct sslbp_field *const field)
{
    uint32_t head = 0, min = 0, max = 0, address = 0;
    int err = get(reader, (uint16_t)(at + AT_TYPE), 4, &head);
    if (err == 0)
        err = get(reader, (uint16_t)(at + AT_MIN), 4, &min);
    if (err == 0)
        err = get(reader, (uint16_t)(at + AT_MAX), 4, &max);
    if (err == 0)
        err = get(reader, (uint16_t)(at + AT_ADDRESS), 2, &address);
    field->bits = (uint8_t)(head >> 8);
    field->type = (uint8_t)(head >> 16);
    field->direction = (uint8_t)(head >> 24);
    field->min = get_single(min);
    field->max = get_single(max);
    if (field->min == field->max) {
        field->min = 0.0;
        field->max = 1.0;
    }
    field->address = (uint16_t)address;
    uint16_t text = (uint16_t)(at + AT_TEXT);
    if (err == 0)
        err = get_text(reader, &text, field->unit);
    return err < 0 ? err : get_text(reader, &text, field->name);
}

static int get_mode(const struct reader *const reader, const uint16_t at)
{
    struct sslbp_tables *const tables = reader->tables;
    if (tables->mode_count == SSLBP_MODE_MAX)
        return 0;
    struct sslbp_mode *const mode = &tables->mode[tables->mode_count];
    uint32_t head = 0;
    int err = get(reader, at, 4, &head);
    mode->index = (uint8_t)(head >> 8);
    mode->kind = (uint8_t)(head >> 16);
    uint16_t text = (uint16_t)(at + AT_MODE_NAME);
    if (err == 0)
        err = get_text(reader, &text, mode->name);
    if (err == 0)
        tables->mode_count++;
    return err;
}

/* ---- what may stand in process data -------------------------------------------------------------------------------
 */

struct rule {
    uint8_t type, min_bits, max_bits;
    bool named, directions[3]; /* input, both, output */
};

static const struct rule rules[] = {
    {SSLBP_PAD, 1, 255, false, {true, true, true}},         {SSLBP_BITS, 1, 224, true, {true, true, true}},
    {SSLBP_UNSIGNED, 1, WIDEST, true, {true, true, true}},  {SSLBP_SIGNED, 2, WIDEST, true, {true, true, true}},
    {SSLBP_STREAM, 1, WIDEST, true, {true, true, true}},    {SSLBP_BOOLEAN, 1, WIDEST, true, {true, true, true}},
    {SSLBP_ENCODER, 2, WIDEST, true, {true, false, false}}, {SSLBP_FLOAT, 32, WIDEST, true, {true, true, true}},
    {SSLBP_ENCODER_H, 1, 32, true, {true, false, false}},   {SSLBP_ENCODER_L, 1, 32, false, {true, false, false}},
};

static bool is_sound(const struct sslbp_field *const field)
{
    for (size_t i = 0; i < sizeof rules / sizeof rules[0]; i++) {
        const struct rule *const rule = &rules[i];
        if (rule->type != field->type)
            continue;
        const bool length = field->bits >= rule->min_bits && field->bits <= rule->max_bits &&
                            (field->type != SSLBP_FLOAT || field->bits % 32u == 0);
        const bool direction = field->direction % 0x40u == 0 && field->direction <= SSLBP_OUTPUT &&
                               rule->directions[field->direction / 0x40u];
        return length && direction && (field->name[0] || !rule->named);
    }
    return false;
}

static int add_process(const struct reader *const reader, const uint16_t at)
{
    struct sslbp_tables *const tables = reader->tables;
    if (tables->process_count == SSLBP_PROCESS_MAX)
        return hm2_diag_add(reader->diag, HM2_ERR_MALFORMED, "%s: more than %u process data records", reader->name,
                            SSLBP_PROCESS_MAX);
    struct sslbp_field *const field = &tables->process[tables->process_count];
    const int err = get_field(reader, at, field);
    if (err < 0)
        return err;
    if (!is_sound(field))
        return hm2_diag_add(reader->diag, HM2_ERR_MALFORMED,
                            "%s: process data record at 0x%04X, \"%s\": type 0x%02X, %u bits, direction 0x%02X found, "
                            "which do not go together; the remote's firmware is unknown to this driver",
                            reader->name, at, field->name, field->type, field->bits, field->direction);
    tables->process_count++;
    tables->in_bits += field->direction == SSLBP_OUTPUT ? 0 : field->bits;
    tables->out_bits += field->direction == SSLBP_INPUT ? 0 : field->bits;
    if (tables->in_bits <= reader->user_bits && tables->out_bits <= reader->user_bits)
        return 0;
    return hm2_diag_add(reader->diag, HM2_ERR_MALFORMED,
                        "%s: %u bits of input and %u of output found, at most %u each expected", reader->name,
                        tables->in_bits, tables->out_bits, reader->user_bits);
}

/* Process data stand in both tables; the address of the parameter tells (hal-interface 4.4). */
static bool is_process(const struct sslbp_tables *const tables, const uint16_t address)
{
    for (unsigned i = 0; i < tables->process_count; i++)
        if (tables->process[i].address == address)
            return true;
    return false;
}

static bool is_parameter(const uint8_t type)
{
    return type == SSLBP_UNSIGNED || type == SSLBP_SIGNED || type == SSLBP_NV_UNSIGNED || type == SSLBP_NV_SIGNED ||
           type == SSLBP_FLOAT || type == SSLBP_NV_FLOAT;
}

/* Globals of other types are nothing that a parameter could show. */
static int add_global(const struct reader *const reader, const uint16_t at)
{
    struct sslbp_tables *const tables = reader->tables;
    struct sslbp_field field;
    const int err = get_field(reader, at, &field);
    if (err < 0 || is_process(tables, field.address) || !is_parameter(field.type))
        return err;
    const bool single = field.type != SSLBP_FLOAT && field.type != SSLBP_NV_FLOAT;
    if (!field.name[0] || field.bits == 0 || field.bits > WIDEST || (!single && field.bits % 32u))
        return hm2_diag_add(reader->diag, HM2_ERR_MALFORMED,
                            "%s: parameter record at 0x%04X, \"%s\": type 0x%02X with %u bits found", reader->name, at,
                            field.name, field.type, field.bits);
    if (tables->global_count == SSLBP_GLOBAL_MAX)
        return hm2_diag_add(reader->diag, HM2_ERR_MALFORMED, "%s: more than %u parameters", reader->name,
                            SSLBP_GLOBAL_MAX);
    tables->global[tables->global_count++] = field;
    return 0;
}

/* One table: a list of pointers that ends with 0. Records of unknown kinds are passed over. */
static int read_toc(const struct reader *const reader, const uint16_t toc, const char *const which,
                    int (*const add)(const struct reader *reader, uint16_t at), const bool with_modes)
{
    for (unsigned i = 0; i < TOC_MAX; i++) {
        uint32_t pointer = 0, kind = 0;
        int err = get(reader, (uint16_t)(toc + 2u * i), 2, &pointer);
        if (err < 0 || pointer == 0)
            return err;
        err = get(reader, (uint16_t)pointer, 1, &kind);
        if (err == 0 && (uint8_t)kind == RECORD_PROCESS)
            err = add(reader, (uint16_t)pointer);
        else if (err == 0 && (uint8_t)kind == RECORD_MODE && with_modes)
            err = get_mode(reader, (uint16_t)pointer);
        if (err < 0)
            return err;
    }
    return hm2_diag_add(reader->diag, HM2_ERR_MALFORMED, "%s: the %s at 0x%04X has no end within %u entries",
                        reader->name, which, toc, TOC_MAX);
}

int sslbp_read_tables(const struct sslbp_memory *const memory, const struct sslbp_identity *const identity,
                      const unsigned user_bits, const char *const name, struct sslbp_tables *const tables,
                      struct hm2_diag *const diag)
{
    const struct reader reader = {memory, name, user_bits, tables, diag, false};
    *tables = (struct sslbp_tables){0};
    const int err = read_toc(&reader, identity->ptoc, "PTOC", add_process, true);
    if (err < 0 || identity->gtoc == 0)
        return err;
    return read_toc(&reader, identity->gtoc, "GTOC", add_global, tables->mode_count == 0);
}

static int add_entry(const struct reader *const reader, const uint16_t at)
{
    struct sslbp_tables *const tables = reader->tables;
    if (tables->global_count == SSLBP_GLOBAL_MAX)
        return hm2_diag_add(reader->diag, HM2_ERR_MALFORMED, "%s: more than %u parameters", reader->name,
                            SSLBP_GLOBAL_MAX);
    const int err = get_field(reader, at, &tables->global[tables->global_count]);
    tables->global_count += err == 0;
    return err;
}

int sslbp_read_list(const struct sslbp_memory *const memory, const struct sslbp_identity *const identity,
                    const char *const name, struct sslbp_tables *const tables, struct hm2_diag *const diag)
{
    const struct reader reader = {memory, name, 0, tables, diag, true};
    *tables = (struct sslbp_tables){0};
    return identity->gtoc == 0 ? 0 : read_toc(&reader, identity->gtoc, "GTOC", add_entry, true);
}

unsigned sslbp_field_bytes(const struct sslbp_field *const field)
{
    return field->bits <= 8 ? 1 : field->bits <= 16 ? 2 : field->bits <= 32 ? 4 : 8;
}

bool sslbp_is_nonvolatile(const struct sslbp_field *const field)
{
    return field->type == SSLBP_NV_UNSIGNED || field->type == SSLBP_NV_SIGNED || field->type == SSLBP_NV_FLOAT;
}

bool sslbp_is_signed(const struct sslbp_field *const field)
{
    return field->type == SSLBP_SIGNED || field->type == SSLBP_NV_SIGNED;
}
