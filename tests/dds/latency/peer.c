// A peer on Cyclone DDS that measures: it commands the node, hears its states, and sends the same commands through a plain echo.
//
// Usage: peer echo                    gives back each command of rt/echo/in on rt/echo/out, until it is killed
//        peer bare SECONDS PERIOD FILE  wakes each PERIOD ns, half of it after the node, and writes how late each time, ns; as the node
//                                     does, it catches up after a stall and leaves no wake-up out
//        peer drive SECONDS FILE      commands rt/governor/command and rt/echo/in in turn, 100 times a second each
// FILE gets a line for each event, times in ns of the machine's clock: `sent TIME OPENING`, `echo SENT RECEIVED`,
// `state STAMP RECEIVED`. CYCLONEDDS_URI and ROS_DOMAIN_ID as usual.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "dds/dds.h"
#include "latency.h"

typedef governor_msgs_msg_dds__GovernorCommand_ Command;
typedef governor_msgs_msg_dds__ServoState_ State;

struct row { char kind; int64_t a, b; double opening; };
static struct row *rows;
static volatile size_t taken;
static size_t room;

static int64_t now(clockid_t clock) {
    struct timespec time;
    clock_gettime(clock, &time);
    return time.tv_sec * 1000000000LL + time.tv_nsec;
}

static int64_t nanos(const std_msgs_msg_dds__Header_ *header) {
    return header->stamp.sec * 1000000000LL + header->stamp.nanosec;
}

static void keep(char kind, int64_t a, int64_t b, double opening) {
    size_t place = __atomic_fetch_add(&taken, 1, __ATOMIC_RELAXED);
    if (place < room) rows[place] = (struct row){kind, a, b, opening};
}

static dds_entity_t topic(dds_entity_t participant, const dds_topic_descriptor_t *kind, const char *name) {
    dds_entity_t made = dds_create_topic(participant, kind, name, NULL, NULL);
    if (made < 0) { fprintf(stderr, "peer: %s: %s\n", name, dds_strretcode(-made)); exit(1); }
    return made;
}

static void give_back(dds_entity_t reader, void *writer) {
    void *samples[1] = {NULL};
    dds_sample_info_t info;
    while (dds_take(reader, samples, &info, 1, 1) > 0) {
        if (info.valid_data) dds_write(*(dds_entity_t *)writer, samples[0]);
        dds_return_loan(reader, samples, 1);
    }
}

static void hear_echo(dds_entity_t reader, void *nothing) {
    void *samples[1] = {NULL};
    dds_sample_info_t info;
    (void)nothing;
    while (dds_take(reader, samples, &info, 1, 1) > 0) {
        if (info.valid_data) keep('e', nanos(&((Command *)samples[0])->header), now(CLOCK_REALTIME), 0.0);
        dds_return_loan(reader, samples, 1);
    }
}

static void hear_state(dds_entity_t reader, void *nothing) {
    void *samples[1] = {NULL};
    dds_sample_info_t info;
    (void)nothing;
    while (dds_take(reader, samples, &info, 1, 1) > 0) {
        if (info.valid_data) keep('s', nanos(&((State *)samples[0])->header), now(CLOCK_REALTIME), 0.0);
        dds_return_loan(reader, samples, 1);
    }
}

static int bare(long seconds, int64_t period, const char *path) {
    int64_t times = seconds * 1000000000LL / period, *late = calloc((size_t)times, sizeof *late);
    int64_t due = (now(CLOCK_MONOTONIC) / period + 2) * period + period / 2;
    for (int64_t n = 0; n < times; n++, due += period) {
        struct timespec until = {due / 1000000000LL, due % 1000000000LL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        late[n] = now(CLOCK_MONOTONIC) - due;
    }
    FILE *file = fopen(path, "w");
    for (int64_t n = 0; file && n < times; n++) fprintf(file, "%lld\n", (long long)late[n]);
    return file && !fclose(file) ? 0 : 1;
}

int main(int count, char **words) {
    if (count == 5 && !strcmp(words[1], "bare")) return bare(atol(words[2]), atoll(words[3]), words[4]);
    const char *text = getenv("ROS_DOMAIN_ID");
    dds_entity_t participant = dds_create_participant(text ? (dds_domainid_t)atoi(text) : 0, NULL, NULL);
    const dds_topic_descriptor_t *command = &governor_msgs_msg_dds__GovernorCommand__desc;
    const dds_topic_descriptor_t *state = &governor_msgs_msg_dds__ServoState__desc;
    dds_qos_t *qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 10);
    dds_listener_t *listener;
    if (count == 2 && !strcmp(words[1], "echo")) {
        static dds_entity_t writer;
        writer = dds_create_writer(participant, topic(participant, command, "rt/echo/out"), qos, NULL);
        listener = dds_create_listener(&writer);
        dds_lset_data_available(listener, give_back);
        dds_create_reader(participant, topic(participant, command, "rt/echo/in"), qos, listener);
        for (;;) dds_sleepfor(DDS_SECS(3600));
    }
    if (count != 4 || strcmp(words[1], "drive")) {
        fprintf(stderr, "usage: peer echo | peer bare SECONDS PERIOD FILE | peer drive SECONDS FILE\n");
        return 2;
    }
    long seconds = atol(words[2]);
    room = (size_t)seconds * 2500 + 1000;
    rows = calloc(room, sizeof *rows);
    listener = dds_create_listener(NULL);
    dds_lset_data_available(listener, hear_echo);
    dds_create_reader(participant, topic(participant, command, "rt/echo/out"), qos, listener);
    listener = dds_create_listener(NULL);
    dds_lset_data_available(listener, hear_state);
    dds_create_reader(participant, topic(participant, state, "rt/sim/servo_state"), qos, listener);
    dds_entity_t node = dds_create_writer(participant, topic(participant, command, "rt/governor/command"), qos, NULL);
    dds_entity_t echo = dds_create_writer(participant, topic(participant, command, "rt/echo/in"), qos, NULL);
    for (int tries = 0; tries < 400; tries++) {
        dds_publication_matched_status_t first = {0}, second = {0};
        dds_get_publication_matched_status(node, &first);
        dds_get_publication_matched_status(echo, &second);
        if (first.current_count && second.current_count) break;
        dds_sleepfor(DDS_MSECS(50));
    }
    int64_t begin = now(CLOCK_MONOTONIC);
    for (long step = 0; step < seconds * 200; step++) {
        // 5 ms apart, and a little more each time, so that all phases of the node's tick are met.
        int64_t due = begin + step * 5000000LL + step % 997 * 1003;
        struct timespec until = {due / 1000000000LL, due % 1000000000LL};
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
        Command sample = {.header = {.frame_id = "bench"}, .opening = 0.4 + 0.1 * sin(step * 0.005) + (double)step * 1e-9};
        int64_t sent = now(CLOCK_REALTIME);
        sample.header.stamp.sec = (int32_t)(sent / 1000000000LL);
        sample.header.stamp.nanosec = (uint32_t)(sent % 1000000000LL);
        dds_write(step % 2 ? echo : node, &sample);
        if (step % 2 == 0) keep('c', sent, 0, sample.opening);
    }
    dds_sleepfor(DDS_MSECS(500));
    FILE *file = fopen(words[3], "w");
    size_t last = taken < room ? taken : room;
    for (size_t n = 0; file && n < last; n++) {
        if (rows[n].kind == 'c') fprintf(file, "sent %lld %.17g\n", (long long)rows[n].a, rows[n].opening);
        if (rows[n].kind == 'e') fprintf(file, "echo %lld %lld\n", (long long)rows[n].a, (long long)rows[n].b);
        if (rows[n].kind == 's') fprintf(file, "state %lld %lld\n", (long long)rows[n].a, (long long)rows[n].b);
    }
    return file && !fclose(file) ? 0 : 1;
}
