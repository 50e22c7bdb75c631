/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* Two ways to a remote in set-up mode. */
#include <hm2/lbp_remote.h>

#define FLASH_REPLY_NS INT64_C(2000000000) /* erasing takes longer than anything else */

static int client_read(void *const context, const uint16_t address, const unsigned bytes, uint64_t *const value)
{
    return lbp_client_read(context, address, bytes, value);
}

static int client_write(void *const context, const uint16_t address, const unsigned bytes, const uint64_t value)
{
    return lbp_client_write(context, address, bytes, value);
}

static int client_memory(void *const context, const enum lbp_memory memory)
{
    struct lbp_client *const client = context;
    if (memory == LBP_MEMORY_FLASH && client->reply_ns < FLASH_REPLY_NS)
        client->reply_ns = FLASH_REPLY_NS;
    return lbp_client_set(client, LBP_SET_NV_ACCESS, (uint8_t)memory);
}

static int client_local(void *const context, const enum lbp_local code, uint8_t *const value)
{
    return lbp_client_get(context, code, value);
}

struct lbp_access lbp_client_access(struct lbp_client *const client)
{
    return (struct lbp_access){client, client_read, client_write, client_memory, client_local};
}

/* ---- through a port
 * ------------------------------------------------------------------------------------------------*/

static int port_read(void *const context, const uint16_t address, const unsigned bytes, uint64_t *const value)
{
    const struct lbp_port_channel *const at = context;
    return sslbp_remote_read(at->port, at->channel, address, bytes, value);
}

static int port_write(void *const context, const uint16_t address, const unsigned bytes, const uint64_t value)
{
    const struct lbp_port_channel *const at = context;
    return sslbp_remote_write(at->port, at->channel, address, bytes, value);
}

static int port_memory(void *const context, const enum lbp_memory memory)
{
    const struct lbp_port_channel *const at = context;
    return sslbp_select_memory(at->port, at->channel, (uint8_t)memory);
}

static int port_local(void *const context, const enum lbp_local code, uint8_t *const value)
{
    const struct lbp_port_channel *const at = context;
    return sslbp_remote_local(at->port, at->channel, (uint8_t)code, value);
}

struct lbp_access lbp_port_access(struct lbp_port_channel *const channel)
{
    return (struct lbp_access){channel, port_read, port_write, port_memory, port_local};
}

int lbp_port_identify(const struct lbp_port_channel *const channel, struct lbp_identity *const identity)
{
    struct sslbp_identity found;
    const int err = sslbp_identify(channel->port, channel->channel, &found);
    *identity = (struct lbp_identity){.unit = found.unit, .ptoc = found.ptoc, .gtoc = found.gtoc};
    for (unsigned i = 0; i < 4; i++) {
        const unsigned char c = (unsigned char)(found.name >> 8u * i);
        identity->name[i] = (char)(c > ' ' && c <= '~' ? c : '-');
    }
    return err;
}
