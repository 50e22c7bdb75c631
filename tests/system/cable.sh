#!/bin/bash
# SPDX-License-Identifier: GPL-2.0-or-later
# shellcheck disable=SC2154 # the reader of this file sets build and private
# Read by scripts that run a simulated card behind a cable, inside namespaces of their own (network and mounts) and with
# the variables build (folder of the programs) and private (a folder of this run), and the function skip.
#   lay_cable LOG CARD [hm2sim options...]   two networks and a cable; the card at 192.168.1.121, this host's end is
#                                            "host" with 192.168.1.1. Sets sim to the simulator's process.
#   in_card COMMAND...                       runs in the card's network
# The card's end of the cable must carry the MAC address that the card's EEPROM reports, or no packet arrives once
# LinuxCNC's driver has pinned the address.

mac=00:60:1b:12:34:56
wait_s=20

in_card() { nsenter --net=/proc/"$sim"/ns/net "$@"; }

lay_cable() {
    local log=$1 card=$2 end
    shift 2
    mkfifo "$private/go"
    # shellcheck disable=SC2016 # expanded by the inner shell
    unshare --net sh -c 'read -r _ <"$1"; shift; exec "$@"' sh "$private/go" "$build/hm2sim" --card "$card" \
        --bind 192.168.1.121 --mac $mac --realtime "$@" >"$log" 2>&1 &
    sim=$!
    while [ "$(readlink /proc/$sim/ns/net)" = "$(readlink /proc/self/ns/net)" ]; do sleep 0.05; done
    ip link add host type veth peer name card netns $sim 2>"$private/err" ||
        skip "no veth devices here: $(head -n 1 "$private/err")"
    in_card ip link set card address $mac
    ip addr add 192.168.1.1/24 dev host
    in_card ip addr add 192.168.1.121/24 dev card
    for end in lo host; do ip link set $end up; done
    for end in lo card; do in_card ip link set $end up; done
    echo >"$private/go"
    for _ in $(seq $((wait_s * 10))); do
        grep -q '^ready' "$log" && return
        kill -0 $sim 2>/dev/null || break
        sleep 0.1
    done
    echo "hm2sim did not start:"
    cat "$log"
    exit 1
}
