/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include <hm2/lbp_remote.h>

#include <stdio.h>
#include <string.h>
#include <strings.h>

#define USER_BITS 224u /* of the widest port */
#define WIDEST    64u

static int read_memory(void *const access, const uint16_t address, const unsigned bytes, uint32_t *const value)
{
    const struct lbp_access *const at = access;
    uint64_t wide = 0;
    const int err = at->read(at->context, address, bytes, &wide);
    *value = (uint32_t)wide;
    return err;
}

int lbp_remote_discover(struct lbp_remote *const remote)
{
    const struct sslbp_memory memory = {&remote->access, read_memory};
    const struct sslbp_identity identity = {
        .unit = remote->identity.unit, .ptoc = remote->identity.ptoc, .gtoc = remote->identity.gtoc};
    if (identity.ptoc == 0)
        return hm2_diag_add(remote->diag, HM2_ERR_UNSUPPORTED,
                            "%s: this %s has no tables of its parameters, so that none can be named.", remote->name,
                            remote->identity.name);
    return sslbp_read_tables(&memory, &identity, USER_BITS, remote->name, &remote->tables, remote->diag);
}

const struct sslbp_field *lbp_remote_field(const struct lbp_remote *const remote, const unsigned index)
{
    const struct sslbp_tables *const tables = &remote->tables;
    if (index < tables->global_count)
        return &tables->global[index];
    return index - tables->global_count < tables->process_count ? &tables->process[index - tables->global_count] : NULL;
}

static void add_name(char *const list, const size_t size, const char *const name)
{
    const size_t used = strlen(list);
    (void)snprintf(list + used, size - used, "%s%s", used ? ", " : "", name);
}

int lbp_remote_find(const struct lbp_remote *const remote, const char *const name,
                    const struct sslbp_field **const field)
{
    const struct sslbp_field *candidate;
    char all[1024] = "", fitting[1024] = "";
    unsigned count = 0;
    *field = NULL;
    for (unsigned i = 0; (candidate = lbp_remote_field(remote, i)); i++) {
        if (candidate->name[0] == '\0')
            continue;
        add_name(all, sizeof all, candidate->name);
        if (strncasecmp(candidate->name, name, strlen(name)) != 0)
            continue;
        *field = candidate;
        if (strlen(candidate->name) == strlen(name))
            return 0;
        add_name(fitting, sizeof fitting, candidate->name);
        count++;
    }
    if (count == 0 || name[0] == '\0')
        return hm2_diag_add(remote->diag, HM2_ERR_NOTFOUND, "%s: no parameter \"%.48s\"; this %s has: %s.",
                            remote->name, name, remote->identity.name, all);
    if (count > 1)
        return hm2_diag_add(remote->diag, HM2_ERR_INVALID, "%s: \"%.48s\" is the beginning of several: %s.",
                            remote->name, name, fitting);
    return 0;
}

/* ---- values -------------------------------------------------------------------------------------------------------
 */

static unsigned bytes_of(const struct sslbp_field *const field)
{
    return (field->bits + 7u) / 8u;
}

static uint64_t mask_of(const struct sslbp_field *const field)
{
    return field->bits < WIDEST ? (UINT64_C(1) << field->bits) - 1u : UINT64_MAX;
}

/* The largest access that fits into what is left. */
static unsigned piece(const unsigned left)
{
    return left >= 8 ? 8 : left >= 4 ? 4 : left >= 2 ? 2 : 1;
}

static int transfer(const struct lbp_remote *const remote, const struct sslbp_field *const field, const bool write,
                    uint64_t *const raw)
{
    const struct lbp_access *const at = &remote->access;
    const unsigned bytes = bytes_of(field);
    uint64_t value = 0;
    int err = 0;
    for (unsigned done = 0, size = 0; !err && done < bytes && done < sizeof value; done += size) {
        const uint16_t address = (uint16_t)(field->address + done);
        uint64_t part = *raw >> 8u * done;
        size = piece(bytes - done);
        err = write ? at->write(at->context, address, size, part) : at->read(at->context, address, size, &part);
        value |= part << 8u * done;
    }
    if (!write)
        *raw = value & mask_of(field);
    return err;
}

static int check_width(const struct lbp_remote *const remote, const struct sslbp_field *const field)
{
    if (field->bits > 0 && field->bits <= WIDEST)
        return 0;
    return hm2_diag_add(remote->diag, HM2_ERR_UNSUPPORTED, "%s: %s has %u bits, 64 can be read or written at a time.",
                        remote->name, field->name, field->bits);
}

/* Do something while addresses mean the EEPROM, and always end that. */
static int in_eeprom(const struct lbp_remote *const remote, const struct sslbp_field *const field,
                     int (*const act)(const struct lbp_remote *, const struct sslbp_field *, uint64_t *),
                     uint64_t *const raw)
{
    const struct lbp_access *const at = &remote->access;
    int err = at->memory(at->context, LBP_MEMORY_EEPROM);
    if (!err)
        err = act(remote, field, raw);
    const int closed = at->memory(at->context, LBP_MEMORY_WORKING);
    return err ? err : closed;
}

static int get(const struct lbp_remote *const remote, const struct sslbp_field *const field, uint64_t *const raw)
{
    return transfer(remote, field, false, raw);
}

static int put_and_compare(const struct lbp_remote *const remote, const struct sslbp_field *const field,
                           uint64_t *const raw)
{
    uint64_t found = 0;
    int err = transfer(remote, field, true, raw);
    if (!err)
        err = transfer(remote, field, false, &found);
    if (!err && found != *raw)
        return hm2_diag_add(remote->diag, HM2_ERR_MISMATCH,
                            "%s: %s reads 0x%llX after 0x%llX was written; the remote did not take it.", remote->name,
                            field->name, (unsigned long long)found, (unsigned long long)*raw);
    return err;
}

int lbp_remote_get(const struct lbp_remote *const remote, const struct sslbp_field *const field, uint64_t *const raw)
{
    const int err = check_width(remote, field);
    *raw = 0;
    if (err)
        return err;
    return sslbp_is_nonvolatile(field) ? in_eeprom(remote, field, get, raw) : get(remote, field, raw);
}

int lbp_remote_put(const struct lbp_remote *const remote, const struct sslbp_field *const field, uint64_t raw)
{
    const int err = check_width(remote, field);
    if (err)
        return err;
    if (field->direction == SSLBP_INPUT)
        return hm2_diag_add(remote->diag, HM2_ERR_STATE, "%s: %s can only be read.", remote->name, field->name);
    return sslbp_is_nonvolatile(field) ? in_eeprom(remote, field, put_and_compare, &raw)
                                       : transfer(remote, field, true, &raw);
}
