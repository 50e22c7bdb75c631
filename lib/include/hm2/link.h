/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * How datagrams reach a device and come back.
 *
 * A link moves whole datagrams. It owns the clock in which deadlines are expressed, so the same state machine runs
 * against a socket (CLOCK_MONOTONIC) and against the mock or the simulated card (virtual time). send() and recv() of
 * an open link are realtime safe: no allocation, no lock, no system call but those that move the datagram.
 * A link is used by one thread at a time.
 */
#ifndef HM2_LINK_H
#define HM2_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <hm2/err.h>

/* Largest UDP payload without fragmentation on Ethernet: 1500 - 20 (IPv4) - 8 (UDP); the cards do not fragment
 * (seed 000, "HOST COMMUNICATION"). */
#define LINK_MAX_DATAGRAM_BYTES 1472u

struct link;

#define LINK_CLOCK_UNREAD INT64_MIN

struct link_ops {
    /* Send one datagram. 0, HM2_ERR_IO, HM2_ERR_NOSPACE (longer than LINK_MAX_DATAGRAM_BYTES). */
    int (*send)(struct link *link, const void *data, size_t len);
    /* Receive one datagram that comes from the device. Returns its length (0..cap), HM2_ERR_TIMEOUT when none came
     * before deadline_ns, HM2_ERR_IO, HM2_ERR_NOSPACE when it was longer than cap (it is consumed). A deadline in
     * the past returns what is queued already. clock_ns is what the caller has just read from the link's clock, or
     * LINK_CLOCK_UNREAD: a link may take it for the present time once instead of reading the clock again, and then
     * waits longer by as much as it is old. */
    int (*recv)(struct link *link, void *data, size_t cap, int64_t deadline_ns, int64_t clock_ns);
    int64_t (*now_ns)(struct link *link);
    void (*close)(struct link *link); /* releases everything, the link itself included */
};

/* What a link counts by itself, written by the thread that uses the link; strangers by a thread of the link's own, so
 * read it with link_strangers(). */
struct link_counters {
    uint64_t sent, received;
    uint64_t send_errors;
    uint64_t receive_errors;
    uint64_t strangers; /* datagrams for our port that came from somebody else than the device */
};

struct link {
    const struct link_ops *ops;
    struct link_counters counters;
};

static inline int HM2_MUST_CHECK link_send(struct link *const link, const void *const data, const size_t len)
{
    return link->ops->send(link, data, len);
}

static inline int HM2_MUST_CHECK link_recv(struct link *const link, void *const data, const size_t cap,
                                           const int64_t deadline_ns)
{
    return link->ops->recv(link, data, cap, deadline_ns, LINK_CLOCK_UNREAD);
}

/* The same with a reading of the clock that the caller has just made. */
static inline int HM2_MUST_CHECK link_recv_from(struct link *const link, void *const data, const size_t cap,
                                                const int64_t deadline_ns, const int64_t clock_ns)
{
    return link->ops->recv(link, data, cap, deadline_ns, clock_ns);
}

static inline int64_t link_now_ns(struct link *const link)
{
    return link->ops->now_ns(link);
}

static inline void link_close(struct link *const link)
{
    if (link)
        link->ops->close(link);
}

/* Datagrams of strangers so far; realtime and thread safe. */
static inline uint64_t link_strangers(const struct link *const link)
{
    return __atomic_load_n(&link->counters.strangers, __ATOMIC_RELAXED);
}

/* ---- UDP ------------------------------------------------------------------------------------------------------- */

struct link_udp_options {
    const char *address;   /* dotted IPv4 of the card, optionally ":port" (default LBP16's 27181) */
    unsigned busy_poll_us; /* try so long without sleeping, with SO_BUSY_POLL (refused = a warning); 0 = off */
    bool spin;             /* try until the deadline without sleeping; a processor does nothing else meanwhile */
    bool watch_strangers;  /* count datagrams from others, in a thread that never touches the cyclic socket */
};

/* Open a connected socket: packets of strangers never reach recv(). Not realtime safe. On failure diag says why.
 *
 * Clock: CLOCK_MONOTONIC. System calls: send() is one send(2); recv() is one ppoll(2) and one recv(2) for a datagram
 * that comes in time, one recv(2) alone when the deadline is over already. While it polls busily or spins, recv()
 * calls recv(2) again and again instead.
 *
 * That nobody listens at the card's address (ICMP errors, no route) is not an error of the link: the datagram counts
 * as lost and in send_errors or receive_errors, send() returns 0 and recv() goes on waiting; the card may come back.
 *
 * The watch is a second socket, bound to the same local address and port, which gets what the connected one does not
 * match. Its thread runs with normal priority, blocks all signals, counts at most 64 datagrams a millisecond and ends
 * at close. */
HM2_API int HM2_MUST_CHECK link_udp_open(struct link **link, const struct link_udp_options *options,
                                         struct hm2_diag *diag);

/* ---- serial port ------------------------------------------------------------------------------------------------ */

/* Open a serial port for this program alone: raw, 8N1, without flow control. Not realtime safe; closing restores its
 * settings. HM2_ERR_STATE = another program has it, HM2_ERR_RANGE = no such baud rate, HM2_ERR_IO, HM2_ERR_INVALID;
 * diag says why.
 *
 * A serial line has no datagrams: send() hands all bytes to the port at once, recv() returns what has arrived, at least
 * one byte and at most cap, and never HM2_ERR_NOSPACE. A port that is gone is HM2_ERR_IO. Clock: CLOCK_MONOTONIC. */
HM2_API int HM2_MUST_CHECK link_tty_open(struct link **link, const char *path, uint32_t baud, struct hm2_diag *diag);

/* ---- mock: scripted exchanges in virtual time ------------------------------------------------------------------ */

/* One reply that a mock gives. delay_ns counts from the send that it answers. */
struct link_mock_reply {
    const void *data;
    size_t len;
    int64_t delay_ns;
};

/* Called for every datagram sent; queues replies with link_mock_push(). Returns 0 or the error that send() shall
 * return. */
typedef int (*link_mock_handler)(void *context, struct link *mock, const uint8_t *data, size_t len);

HM2_API int HM2_MUST_CHECK link_mock_open(struct link **link, link_mock_handler handler, void *context);
/* Queue a datagram for recv(), from a handler or at any other time; the bytes are copied. Up to 64 can wait, of up to
 * 2048 bytes each: HM2_ERR_NOSPACE. Equal arrival times keep their order. HM2_ERR_STATE for a link that is no mock. */
HM2_API int HM2_MUST_CHECK link_mock_push(struct link *mock, const struct link_mock_reply *reply);
/* Virtual time passes. It starts at 0 and also passes in recv(): to the arrival of what it returns, or to the
 * deadline. */
HM2_API void link_mock_advance(struct link *mock, int64_t by_ns);

/*
 * A scripted mock: expects exactly these datagrams in this order. Text, one item a line; "#" begins a comment:
 *   > HEX        expected from the client ("-" = a datagram without bytes; blanks between digits are ignored)
 *   < HEX        the reply to it, at once; any number of them. Before the first ">": arrives unasked
 *   ! lose       the next reply does not arrive
 *   ! dup        the next reply arrives twice
 *   ! delay NS   the next reply arrives so many nanoseconds after the request
 *   ! cut N      the next reply is shortened to N bytes
 *   ! garble N   one bit of byte N (from 0, after "! cut") of the next reply is wrong
 *   ! senderr    the client's next send fails with HM2_ERR_IO, whatever it sends
 * Faults add up; they end with the reply that they meet. After the first send that differs from the script, every
 * send fails with HM2_ERR_MISMATCH. HM2_ERR_MALFORMED with the line number in diag for a script that is wrong.
 */
HM2_API int HM2_MUST_CHECK link_mock_script(struct link **link, const char *script, struct hm2_diag *diag);
/* 0 when the script (or the capture of a replay) was followed to its end; otherwise diag tells line, expected and
 * found. Replies that nobody received are no fault. */
HM2_API int link_mock_finish(struct link *mock, struct hm2_diag *diag);

/* ---- record and replay ----------------------------------------------------------------------------------------- */

/* Wrap a link: every datagram is written, with time and direction, to a text file (format: man page hm2capture(5)).
 * Writing happens in the calling thread: for diagnosis, not for production. Closing closes the inner link too; when
 * opening fails the inner link is still the caller's. */
HM2_API int HM2_MUST_CHECK link_record_open(struct link **link, struct link *inner, const char *path,
                                            struct hm2_diag *diag);
/* Answer from a capture file (up to 256 MiB), in virtual time: a mock link, in which every reply follows its request
 * after the recorded time. A request that differs from the recorded one, and all after it, are HM2_ERR_MISMATCH;
 * link_mock_finish() tells where. HM2_ERR_MALFORMED with the line number in diag for a file that is no capture. */
HM2_API int HM2_MUST_CHECK link_replay_open(struct link **link, const char *path, struct hm2_diag *diag);
/* The same from memory; text need not be terminated and is not needed afterwards. */
HM2_API int HM2_MUST_CHECK link_replay_text(struct link **link, const char *text, size_t len, struct hm2_diag *diag);

#endif
