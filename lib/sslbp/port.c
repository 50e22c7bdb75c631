/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A port at set-up time. Every wait ends: by its time, and where the clock of the bus stands still by its number of
 * polls. Limits are those of LinuxCNC's driver (hal-interface 4.2).
 */
#include <hm2/sslbp.h>

#define MS              INT64_C(1000000)
#define RESET_LIMIT_NS  (1000 * MS)
#define LOCAL_LIMIT_NS  (22 * MS)
#define STOP_LIMIT_NS   (51 * MS)
#define START_LIMIT_NS  (8000 * MS)
#define DOIT_LIMIT_NS   (1000 * MS) /* a remote erases a block of its flash meanwhile; setsserial waits as long */
#define FASTEST_POLL_NS 50000       /* no card answers faster for long */
#define TRIES           3u

/* Local parameters (seed 003, "LOCAL PARAMETERS"; register map 3.8.2). */
enum { LOCAL_TYPE, LOCAL_WIDTH, LOCAL_MAJOR, LOCAL_MINOR, LOCAL_FIRST, LOCAL_STRIDE, LOCAL_PROCESSOR, LOCAL_CHANNELS };
#define TYPE_SSLBP      0x12u
#define WIDTH           8u
#define NOT_INITIALISED 0xAAu /* in the data register when the firmware was not ready (traces) */
#define BLOCK_BAUD      42u   /* offset in a channel's block */
#define MINOR_BAUD      34u

/* LBP commands of set-up mode (seed 003, "SETUP MODE OPERATION"). */
#define LBP_READ   0x44u
#define LBP_WRITE  0x64u
#define LBP_MEMORY 0xECu

static int peek(const struct sslbp_port *const port, const uint16_t address, uint32_t *const value)
{
    return port->bus.read(port->bus.access, address, 1, value);
}

static int poke(const struct sslbp_port *const port, const uint16_t address, const uint32_t value)
{
    return port->bus.write(port->bus.access, address, 1, &value);
}

static uint16_t of_channel(const uint16_t address, const unsigned channel)
{
    return (uint16_t)(address + 4u * channel);
}

static int wait_clear(const struct sslbp_port *const port, const int64_t limit_ns)
{
    const int64_t end_ns = port->bus.now_ns(port->bus.access) + limit_ns;
    uint32_t command = 0;
    /* The last look begins when the time is over: an answer that this host was late to see is not the port's fault. */
    for (int64_t polls = limit_ns / FASTEST_POLL_NS + 1; polls > 0; polls--) {
        const bool over = port->bus.now_ns(port->bus.access) >= end_ns;
        const int err = peek(port, port->command, &command);
        if (err < 0 || command == 0)
            return err;
        if (over)
            break;
    }
    return HM2_ERR_TIMEOUT;
}

int sslbp_port_command(const struct sslbp_port *const port, const uint32_t command, const int64_t limit_ns,
                       uint32_t *const data)
{
    int err = command == SSLBP_STOP ? 0 : wait_clear(port, STOP_LIMIT_NS);
    if (err == 0)
        err = poke(port, port->command, command);
    if (err == 0)
        err = wait_clear(port, limit_ns);
    if (err == 0 && data)
        err = peek(port, port->data, data);
    return err;
}

int sslbp_local_read(const struct sslbp_port *const port, const uint16_t address, uint8_t *const value)
{
    uint32_t data = 0;
    const int err = sslbp_port_command(port, SSLBP_LOCAL_READ | address, LOCAL_LIMIT_NS, &data);
    *value = (uint8_t)data;
    return err;
}

int sslbp_local_write(const struct sslbp_port *const port, const uint16_t address, const uint8_t value)
{
    const int err = poke(port, port->data, value);
    return err < 0 ? err : sslbp_port_command(port, SSLBP_LOCAL_WRITE | address, LOCAL_LIMIT_NS, NULL);
}

static int refuse(const struct sslbp_port *const port, const int err, const char *const what)
{
    return hm2_diag_add(port->diag, err, "%s: %s: %s", port->name, what, hm2_strerror(err));
}

/* The firmware drops commands until it has initialised itself and leaves 0xAA in the data register (traces). */
static int wait_for_firmware(struct sslbp_port *const port)
{
    const int64_t end_ns = port->bus.now_ns(port->bus.access) + RESET_LIMIT_NS;
    for (int64_t polls = RESET_LIMIT_NS / FASTEST_POLL_NS; polls > 0; polls--) {
        const int err = sslbp_local_read(port, LOCAL_MINOR, &port->minor);
        if (err < 0 || port->minor != NOT_INITIALISED)
            return err;
        if (port->bus.now_ns(port->bus.access) >= end_ns)
            break;
    }
    return HM2_ERR_TIMEOUT;
}

static int reset(struct sslbp_port *const port)
{
    int err = poke(port, port->command, SSLBP_RESET);
    if (err == 0)
        err = poke(port, port->command, SSLBP_RELEASE);
    if (err == 0)
        err = wait_clear(port, RESET_LIMIT_NS);
    return err < 0 ? err : wait_for_firmware(port);
}

int sslbp_port_open(struct sslbp_port *const port)
{
    int err = reset(port);
    if (err < 0)
        return refuse(port, err, "its firmware does not start");
    uint8_t type = 0, width = 0;
    const struct {
        uint16_t address;
        uint8_t *value;
    } facts[] = {
        {LOCAL_TYPE, &type}, {LOCAL_WIDTH, &width}, {LOCAL_MAJOR, &port->major}, {LOCAL_CHANNELS, &port->channels}};
    for (size_t i = 0; err == 0 && i < sizeof facts / sizeof facts[0]; i++)
        err = sslbp_local_read(port, facts[i].address, facts[i].value);
    if (err < 0)
        return refuse(port, err, "its local parameters cannot be read");
    if (type != TYPE_SSLBP || width != WIDTH || port->channels < 1 || port->channels > SSLBP_CHANNELS)
        return hm2_diag_add(port->diag, HM2_ERR_MISMATCH,
                            "%s: interface type 0x%02X, width %u, %u channels found, 0x%02X, %u, 1 to %u expected; "
                            "its firmware is not SSLBP",
                            port->name, type, width, port->channels, TYPE_SSLBP, WIDTH, SSLBP_CHANNELS);
    err = sslbp_port_stop(port);
    return err < 0 ? refuse(port, err, "it does not stop") : 0;
}

int sslbp_port_baud(const struct sslbp_port *const port, const uint32_t baud)
{
    if (port->minor < MINOR_BAUD)
        return hm2_diag_add(port->diag, HM2_ERR_UNSUPPORTED,
                            "%s: sserial_baudrate needs SSLBP 1.%u or later, %u.%u found", port->name, MINOR_BAUD,
                            port->major, port->minor);
    uint8_t first = 0, stride = 0;
    int err = sslbp_local_read(port, LOCAL_FIRST, &first);
    if (err == 0)
        err = sslbp_local_read(port, LOCAL_STRIDE, &stride);
    for (unsigned channel = 0; channel < port->channels; channel++)
        for (unsigned i = 0; err == 0 && i < 4; i++)
            err = sslbp_local_write(port, (uint16_t)(first + channel * stride + BLOCK_BAUD + i),
                                    (uint8_t)(baud >> 8u * i));
    return err < 0 ? refuse(port, err, "the baud rate cannot be set") : 0;
}

int sslbp_port_stop(const struct sslbp_port *const port)
{
    return sslbp_port_command(port, SSLBP_STOP, STOP_LIMIT_NS, NULL);
}

int sslbp_port_start(const struct sslbp_port *const port, const unsigned mask, const bool setup,
                     const uint8_t modes[SSLBP_CHANNELS], unsigned *const failed)
{
    uint32_t data = 0;
    int err = sslbp_port_stop(port);
    for (unsigned channel = 0; err == 0 && channel < SSLBP_CHANNELS; channel++)
        if (mask >> channel & 1u)
            err = poke(port, of_channel(port->cs, channel), (uint32_t)modes[channel] << 24);
    if (err == 0)
        err = sslbp_port_command(port, (setup ? SSLBP_START_SETUP : SSLBP_START) | mask, START_LIMIT_NS, &data);
    *failed = data & mask;
    return err < 0 ? refuse(port, err, setup ? "it does not start in set-up mode" : "it does not start") : 0;
}

int sslbp_port_cs(const struct sslbp_port *const port, const unsigned channel, uint32_t *const cs)
{
    return peek(port, of_channel(port->cs, channel), cs);
}

/* ---- remotes ------------------------------------------------------------------------------------------------------
 */

static int read_user(const struct sslbp_port *const port, const unsigned channel, const unsigned words,
                     uint32_t *const values)
{
    int err = 0;
    for (unsigned i = 0; err == 0 && i < words; i++)
        err = peek(port, of_channel(port->user[i], channel), &values[i]);
    return err;
}

int sslbp_identify(const struct sslbp_port *const port, const unsigned channel, struct sslbp_identity *const identity)
{
    uint32_t user[3] = {0};
    const int err = read_user(port, channel, 3, user);
    *identity = (struct sslbp_identity){user[0], user[1], (uint16_t)user[2], (uint16_t)(user[2] >> 16)};
    return err;
}

void sslbp_card_name(const struct sslbp_identity *const identity, char name[5])
{
    size_t len = 0;
    for (unsigned i = 0; i < 4; i++) {
        const unsigned char byte = (unsigned char)(identity->name >> 8u * i);
        const unsigned char lower = byte | 0x20u;
        const bool letter = lower >= 'a' && lower <= 'z', digit = byte >= '0' && byte <= '9';
        name[i] = (char)(digit || letter ? (letter && i == 1 ? lower : byte) : '-');
        if (byte != ' ' && byte != '\0')
            len = i + 1u;
    }
    name[len] = '\0';
}

static int doit(const struct sslbp_port *const port, const unsigned channel, const uint32_t cs)
{
    uint32_t data = 0;
    int err = poke(port, of_channel(port->cs, channel), cs);
    if (err == 0)
        err = sslbp_port_command(port, SSLBP_DOIT | 1u << channel, DOIT_LIMIT_NS, &data);
    return err < 0 ? err : data >> channel & 1u ? HM2_ERR_IO : 0;
}

static unsigned size_bits(const unsigned bytes)
{
    return bytes == 8 ? 3 : bytes == 4 ? 2 : bytes == 2 ? 1 : 0;
}

static int remote_failed(const struct sslbp_port *const port, const unsigned channel, const int err,
                         const char *const what, const uint16_t address)
{
    uint32_t cs = 0;
    char text[160] = "nothing";
    if (sslbp_port_cs(port, channel, &cs) == 0) {
        const struct sslbp_status status = sslbp_status(cs, port->minor, true);
        (void)sslbp_status_text(&status, text, sizeof text);
    }
    return hm2_diag_add(port->diag, err, "%s, channel %u: %s the remote's address 0x%04X failed (%s): %s", port->name,
                        channel, what, address, hm2_strerror(err), text);
}

int sslbp_remote_read(const struct sslbp_port *const port, const unsigned channel, const uint16_t address,
                      const unsigned bytes, uint64_t *const value)
{
    uint32_t user[2] = {0};
    int err = HM2_ERR_IO;
    for (unsigned i = 0; err == HM2_ERR_IO && i < TRIES; i++)
        err = doit(port, channel, (LBP_READ | size_bits(bytes)) << 24 | address);
    if (err == 0)
        err = read_user(port, channel, bytes > 4 ? 2 : 1, user);
    *value = user[0] | (uint64_t)user[1] << 32;
    if (bytes < 4)
        *value &= (UINT64_C(1) << 8u * bytes) - 1u;
    return err < 0 ? remote_failed(port, channel, err, "reading", address) : 0;
}

int sslbp_remote_write(const struct sslbp_port *const port, const unsigned channel, const uint16_t address,
                       const unsigned bytes, const uint64_t value)
{
    int err = poke(port, of_channel(port->user[0], channel), (uint32_t)value);
    if (err == 0 && bytes > 4)
        err = poke(port, of_channel(port->user[1], channel), (uint32_t)(value >> 32));
    if (err == 0)
        err = doit(port, channel, (LBP_WRITE | size_bits(bytes)) << 24 | address);
    return err < 0 ? remote_failed(port, channel, err, "writing", address) : 0;
}

int sslbp_select_memory(const struct sslbp_port *const port, const unsigned channel, const uint8_t memory)
{
    int err = poke(port, of_channel(port->user[0], channel), memory);
    if (err == 0)
        err = doit(port, channel, LBP_MEMORY << 24);
    return err < 0 ? remote_failed(port, channel, err, "switching to another memory at", 0) : 0;
}

int sslbp_remote_local(const struct sslbp_port *const port, const unsigned channel, const uint8_t code,
                       uint8_t *const value)
{
    uint32_t user = 0;
    int err = HM2_ERR_IO;
    for (unsigned i = 0; err == HM2_ERR_IO && i < TRIES; i++)
        err = doit(port, channel, (uint32_t)code << 24);
    if (err == 0)
        err = read_user(port, channel, 1, &user);
    *value = (uint8_t)user;
    return err < 0 ? remote_failed(port, channel, err, "asking by a local command, at", (uint16_t)(code << 8u)) : 0;
}

struct remote {
    const struct sslbp_port *port;
    unsigned channel;
};

static int read_memory(void *const access, const uint16_t address, const unsigned bytes, uint32_t *const value)
{
    const struct remote *const remote = access;
    uint64_t wide = 0;
    const int err = sslbp_remote_read(remote->port, remote->channel, address, bytes, &wide);
    *value = (uint32_t)wide;
    return err;
}

int sslbp_discover(const struct sslbp_port *const port, const unsigned channel,
                   const struct sslbp_identity *const identity, const char *const name,
                   struct sslbp_tables *const tables)
{
    struct remote remote = {port, channel};
    const struct sslbp_memory memory = {&remote, read_memory};
    return sslbp_read_tables(&memory, identity, 32u * port->users, name, tables, port->diag);
}

int sslbp_list(const struct sslbp_port *const port, const unsigned channel, const struct sslbp_identity *const identity,
               const char *const name, struct sslbp_tables *const tables)
{
    struct remote remote = {port, channel};
    const struct sslbp_memory memory = {&remote, read_memory};
    return sslbp_read_list(&memory, identity, name, tables, port->diag);
}
