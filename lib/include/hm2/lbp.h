/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * LBP, the byte protocol of smart-serial remotes on their serial line (seed 003, chapter "LBP"; recorded bytes of the
 * real firmware on both ends: tests/data/lbp). The master sends a command, the remote answers it.
 *
 * A message is a command byte, an address of 0 or 2 bytes, data, and a CRC. Everything is little endian. The answer is
 * the data asked for and a CRC; a command that asks for nothing is answered by the CRC alone, which is 0 then.
 *
 * Where the manual disagrees with itself: it gives the discovery RPC once as 0xBB and once as 0xBC, and the unit number
 * RPC the other way round. The recorded master sends 0xBC for the unit number and 0xBB for discovery, and the recorded
 * remote answers so: LBP_RPC_UNIT and LBP_RPC_DISCOVERY are those. The byte counts that discovery returns include the
 * byte of faults in front of the inputs (recorded: 0A for nine bytes of inputs).
 *
 * Codec and parser are pure and realtime safe; the client is not.
 */
#ifndef HM2_LBP_H
#define HM2_LBP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>
#include <hm2/link.h>

/* Command byte (seed 003, "LBP DATA READ/WRITE COMMAND", "RPC COMMANDS"). */
#define LBP_KIND      0xC0u /* these two bits tell: */
#define LBP_DATA      0x40u
#define LBP_RPC       0x80u /* with a number, 0 to 63 */
#define LBP_LOCAL     0xC0u
#define LBP_WRITE     0x20u /* of data and local commands */
#define LBP_RPC_DATA  0x10u /* data are in a stored list of commands, not in the stream */
#define LBP_INCREMENT 0x08u /* the address moves on by the size */
#define LBP_ADDRESS   0x04u /* two bytes follow; else the address pointer as it stands */
#define LBP_SIZE      0x03u /* 1, 2, 4, 8 bytes */

#define LBP_RPC_UNIT      0xBCu /* 4 bytes back */
#define LBP_RPC_DISCOVERY 0xBBu /* bytes to host, bytes to remote, PTOC, GTOC: 6 bytes back */
#define LBP_RPC_PROCESS   0xBDu /* outputs there; faults and inputs back */

/* Local commands (seed 003, "LOCAL LBP COMMANDS"). Reads return one byte, writes have one byte of data (but
 * LBP_RESET_PARSER). Those marked * are not in the manual, or reserved there: recorded, or used by LinuxCNC's driver.
 */
enum lbp_local {
    LBP_GET_ADDRESS = 0xC0,
    LBP_GET_STATUS = 0xC1, /* enum lbp_status */
    LBP_GET_CRC_ENABLE = 0xC2,
    LBP_GET_CRC_ERRORS = 0xC3,
    LBP_GET_FAULTS = 0xC7, /* * asked after clearing them */
    LBP_GET_RPC_ACCESS = 0xCA,
    LBP_GET_TIMEOUT = 0xCB, /* tenths of a character time */
    LBP_GET_NAME = 0xD0,    /* four commands, a character each */
    LBP_GET_CONFIGURATION = 0xD4,
    LBP_GET_LOW_ADDRESS = 0xD8,
    LBP_GET_HIGH_ADDRESS = 0xD9,
    LBP_GET_VERSION = 0xDA,
    LBP_GET_UNIT_ID = 0xDB,
    LBP_GET_RPC_PITCH = 0xDC,
    LBP_GET_RPC_SIZE_LOW = 0xDD,
    LBP_GET_RPC_SIZE_HIGH = 0xDE,
    LBP_GET_COOKIE = 0xDF, /* LBP_COOKIE */
    LBP_SET_STATUS = 0xE1,
    LBP_SET_CRC_ENABLE = 0xE2,
    LBP_SET_CRC_ERRORS = 0xE3,
    LBP_SET_MODE = 0xE6,     /* * software mode, before discovery */
    LBP_CLEAR_FAULTS = 0xE7, /* * those whose bits are set */
    LBP_SET_RPC_ACCESS = 0xEA,
    LBP_SET_TIMEOUT = 0xEB,   /* tenths of a character time (recorded: 28 hex for the manual's four characters) */
    LBP_SET_NV_ACCESS = 0xEC, /* * enum lbp_memory */
    LBP_SET_LEDS = 0xF7,
    LBP_SET_LOW_ADDRESS = 0xF8,
    LBP_SET_HIGH_ADDRESS = 0xF9,
    LBP_ADD_ADDRESS = 0xFA,
    LBP_SET_UNIT_ID = 0xFD,
    LBP_RESET = 0xFE, /* with LBP_COOKIE for data */
    LBP_RESET_PARSER = 0xFF,
};

#define LBP_COOKIE 0x5Au

enum lbp_status {
    LBP_STATUS_CRC = 0x01,
    LBP_STATUS_WATCHDOG = 0x08,
    LBP_STATUS_OVERFLOW = 0x10,
    LBP_STATUS_WRITE = 0x20, /* to a protected address */
    LBP_STATUS_TIMEOUT = 0x40,
};

/* What addresses mean. */
enum lbp_memory { LBP_MEMORY_WORKING = 0, LBP_MEMORY_EEPROM = 1, LBP_MEMORY_FLASH = 2 };

#define LBP_RPCS          64u
#define LBP_MAX_DATA      32u /* process data of 7 interface registers and the faults fit */
#define LBP_MESSAGE_BYTES (3u + LBP_MAX_DATA + 1u)

/* Set-up mode (seed 003, "SETUP/OPERATE MODE", "FRAMING"). */
#define LBP_SETUP_BAUD      115200u
#define LBP_LONGEST_TIMEOUT 255u /* tenths of a character time */
#define LBP_CHARACTER_BITS  10u  /* 8N1 */

/* The Dallas/Maxim CRC, x^8 + x^5 + x^4 + 1 (seed 003, "CRC"), of bytes that follow others whose CRC is crc; 0 at
 * first. Of a message with its CRC it is 0. */
HM2_API uint8_t lbp_crc8(uint8_t crc, const void *data, size_t len);
/* Silence after which a remote begins a new command; 0 for a baud rate of 0. */
HM2_API int64_t lbp_gap_ns(unsigned tenths, uint32_t baud);

struct lbp_command {
    uint8_t code;
    uint16_t address; /* when code says that there is one */
    uint8_t len;      /* of data that go to the remote */
    uint8_t data[LBP_MAX_DATA];
};

/* Bytes that a code other than an RPC has behind it (address included, CRC not) and gets back. 0 for codes of no kind
 * (below 0x40). */
HM2_API unsigned lbp_address_bytes(uint8_t code);
HM2_API unsigned lbp_sent_bytes(uint8_t code);
HM2_API unsigned lbp_returned_bytes(uint8_t code);
/* Code for reading 1, 2, 4 or 8 bytes at an address; with LBP_WRITE for writing. 0 for other sizes. */
HM2_API uint8_t lbp_data_code(unsigned bytes);

/* Write the message; returns its length. HM2_ERR_RANGE when code and len do not go together, HM2_ERR_NOSPACE. */
HM2_API int HM2_MUST_CHECK lbp_encode(const struct lbp_command *command, uint8_t *message, size_t capacity);
/* An answer of bytes (0 or more) and a CRC. HM2_ERR_MALFORMED when the length or the CRC is wrong. */
HM2_API int HM2_MUST_CHECK lbp_check_reply(const uint8_t *message, size_t len, size_t bytes);

/* ---- server: commands from a stream ----------------------------------------------------------------------------- */

struct lbp_parser {
    int64_t gap_ns;              /* silence before a new command; set it */
    uint8_t rpc_bytes[LBP_RPCS]; /* data that follow each RPC, at most LBP_MAX_DATA; set them */
    /* inside */
    uint8_t message[LBP_MESSAGE_BYTES];
    size_t len, needed;
    int64_t last_ns;
    bool lost; /* everything up to the next gap is passed over */
};

HM2_API void lbp_parser_init(struct lbp_parser *parser, int64_t gap_ns);
/* The next byte, received at now_ns. 1 = *command is complete and its CRC right; 0 = more is needed, or the byte was
 * passed over; HM2_ERR_MALFORMED = the CRC is wrong, or no command begins so: all bytes up to the next gap are passed
 * over then; HM2_ERR_TIMEOUT = the byte begins a new message, and the one before was incomplete. */
HM2_API int HM2_MUST_CHECK lbp_parser_take(struct lbp_parser *parser, uint8_t byte, int64_t now_ns,
                                           struct lbp_command *command);

/* ---- client ----------------------------------------------------------------------------------------------------- */

/* Commands to a remote over a link, each answered before the next. What failed is repeated twice, after a silence in
 * which the remote gives up the broken command; commands that move the address pointer are not. */
struct lbp_client {
    struct link *link;
    const char *name;      /* of the line, for messages */
    struct hm2_diag *diag; /* may be NULL */
    int64_t reply_ns;      /* wait so long for an answer */
    int64_t gap_ns;        /* silence before a repetition */
    uint64_t repeated;     /* counts */
};

/* Limits for a line of this baud rate in set-up mode. */
HM2_API void lbp_client_init(struct lbp_client *client, struct link *link, const char *name, uint32_t baud,
                             struct hm2_diag *diag);
/* The answer without its CRC, of exactly `bytes`. HM2_ERR_TIMEOUT, HM2_ERR_MALFORMED (wrong CRC) or HM2_ERR_IO, with a
 * sentence in diag. */
HM2_API int HM2_MUST_CHECK lbp_client_exchange(struct lbp_client *client, const struct lbp_command *command,
                                               uint8_t *reply, size_t bytes);
/* 1, 2, 4 or 8 bytes of the remote's memory. */
HM2_API int HM2_MUST_CHECK lbp_client_read(struct lbp_client *client, uint16_t address, unsigned bytes,
                                           uint64_t *value);
HM2_API int HM2_MUST_CHECK lbp_client_write(struct lbp_client *client, uint16_t address, unsigned bytes,
                                            uint64_t value);
/* Local commands. */
HM2_API int HM2_MUST_CHECK lbp_client_get(struct lbp_client *client, enum lbp_local code, uint8_t *value);
HM2_API int HM2_MUST_CHECK lbp_client_set(struct lbp_client *client, enum lbp_local code, uint8_t value);

/* What a remote says about itself. */
struct lbp_identity {
    uint32_t unit;
    char name[5];
    uint8_t in_bytes, out_bytes; /* of process data, to and from the host, the byte of faults included */
    uint16_t ptoc, gtoc;         /* 0 = cannot be discovered */
};

/* As the recorded master does at START: cookie, time-out, status, unit number, name, mode, discovery. The time-out is
 * made the longest, as a PC wants it. HM2_ERR_MISMATCH when something else than a remote answers. */
HM2_API int HM2_MUST_CHECK lbp_client_identify(struct lbp_client *client, uint8_t mode, struct lbp_identity *identity);

#endif
