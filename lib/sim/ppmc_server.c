/* SPDX-License-Identifier: LGPL-2.1-or-later */
/* A simulated bus for other processes: who connects to the socket, and their requests (hm2/epp.h has the protocol). */
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <hm2/sim_ppmc.h>

#define MAX_CLIENTS 8
#define MAX_EVENTS  (MAX_CLIENTS + 1)

struct sim_ppmc_server {
    int epoll, listener;
    unsigned clients;
    bool bound; /* the socket in the file system is ours to remove */
    struct sockaddr_un address;
};

static int watch(const struct sim_ppmc_server *const server, const int fd)
{
    struct epoll_event event = {.events = EPOLLIN, .data.fd = fd};
    return epoll_ctl(server->epoll, EPOLL_CTL_ADD, fd, &event);
}

static void accept_client(struct sim_ppmc_server *const server)
{
    const int fd = accept4(server->listener, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (fd < 0)
        return;
    if (server->clients == MAX_CLIENTS || watch(server, fd))
        close(fd);
    else
        server->clients++;
}

/* One request. False when the client has gone or says what is no request. */
static bool serve(struct sim_ppmc *const bus, const int fd)
{
    uint8_t request[EPP_WIRE_MAX_BYTES], reply[EPP_WIRE_MAX_BYTES];
    const ssize_t len = recv(fd, request, sizeof request, MSG_TRUNC);
    if (len < 0 && (errno == EAGAIN || errno == EINTR))
        return true;
    const bool fits = len > 0 && (size_t)len <= sizeof request;
    const size_t answer = fits ? sim_ppmc_serve(bus, request, (size_t)len, reply) : 0;
    return answer > 0 && send(fd, reply, answer, MSG_NOSIGNAL) == (ssize_t)answer;
}

void sim_ppmc_server_run(struct sim_ppmc_server *const server, struct sim_ppmc *const bus)
{
    struct epoll_event events[MAX_EVENTS];
    const int count = epoll_wait(server->epoll, events, MAX_EVENTS, 0);
    for (int i = 0; i < count; i++) {
        const int fd = events[i].data.fd;
        if (fd == server->listener) {
            accept_client(server);
        } else if (!serve(bus, fd)) {
            close(fd); /* which ends the watch, too */
            server->clients--;
        }
    }
}

int sim_ppmc_server_fd(const struct sim_ppmc_server *const server)
{
    return server->epoll;
}

static bool open_socket(struct sim_ppmc_server *const server)
{
    const struct sockaddr *const address = (const struct sockaddr *)&server->address;
    server->epoll = epoll_create1(EPOLL_CLOEXEC);
    server->listener = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (server->epoll < 0 || server->listener < 0)
        return false;
    /* One that nobody listens at any more was left by a program that was killed. */
    if (connect(server->listener, address, sizeof server->address) != 0 && errno == ECONNREFUSED)
        unlink(server->address.sun_path);
    server->bound = bind(server->listener, address, sizeof server->address) == 0;
    return server->bound && listen(server->listener, MAX_CLIENTS) == 0 && watch(server, server->listener) == 0;
}

static int start(struct sim_ppmc_server *const server, const char *const path, struct hm2_diag *const diag)
{
    const size_t size = strlen(path) + 1;
    if (size == 1 || size > sizeof server->address.sun_path)
        return hm2_diag_add(diag, HM2_ERR_INVALID, "%.64s: a socket's path has 1 to %zu characters.", path,
                            sizeof server->address.sun_path - 1);
    server->address.sun_family = AF_UNIX;
    memcpy(server->address.sun_path, path, size);
    return open_socket(server) ? 0 : hm2_diag_add(diag, HM2_ERR_IO, "%s: %s.", path, strerror(errno));
}

int sim_ppmc_server_open(struct sim_ppmc_server **const server, const char *const path, struct hm2_diag *const diag)
{
    struct sim_ppmc_server *const made = calloc(1, sizeof *made);
    if (!made)
        return hm2_diag_add(diag, HM2_ERR_NOMEM, "No memory for the socket of a simulated bus.");
    made->epoll = made->listener = -1;
    const int err = start(made, path, diag);
    if (err)
        sim_ppmc_server_close(made);
    else
        *server = made;
    return err;
}

void sim_ppmc_server_close(struct sim_ppmc_server *const server)
{
    if (!server)
        return;
    if (server->bound)
        unlink(server->address.sun_path);
    if (server->listener >= 0)
        close(server->listener);
    if (server->epoll >= 0)
        close(server->epoll);
    free(server);
}
