// A peer on Fast DDS that drives the simulation: steps as an action, the levels of the logger, /clock heard and told.
//
// Prints what it checked and exits with the number of checks that failed. Usage: drive DOMAIN [clock]
// It needs a node that stands at first and publishes /clock; with `clock` one that follows the clock which this program publishes.
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastrtps/rtps/common/WriteParams.h>

#include "benchPubSubTypes.h"
#include "check.hpp"

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::types::ReturnCode_t;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

struct Peer {
    DomainParticipant* participant;
    Publisher* publisher;
    Subscriber* subscriber;

    Topic* topic(const std::string& name, TypeSupport type) const {
        type.register_type(participant);
        return participant->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT);
    }
    DataWriter* writer(const std::string& name, TypeSupport type) const {
        DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
        qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
        return publisher->create_datawriter(topic(name, type), qos);
    }
    DataReader* reader(const std::string& name, TypeSupport type) const {
        DataReaderQos qos = DATAREADER_QOS_DEFAULT;
        qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
        qos.history().kind = KEEP_ALL_HISTORY_QOS;
        return subscriber->create_datareader(topic(name, type), qos);
    }
};

static void wait_for(DataWriter* writer, DataReader* reader) {
    for (int wait = 0; wait < 150; ++wait) {
        PublicationMatchedStatus out;
        SubscriptionMatchedStatus in;
        if (writer != nullptr) writer->get_publication_matched_status(out);
        if (reader != nullptr) reader->get_subscription_matched_status(in);
        if ((writer == nullptr || out.current_count > 0) && (reader == nullptr || in.current_count > 0)) return;
        std::this_thread::sleep_for(milliseconds(100));
    }
}

// One service: a call is sent once.
template <class Request, class Response>
struct Service {
    DataWriter* calls;
    DataReader* replies;

    Service(const Peer& peer, const std::string& name, TypeSupport request, TypeSupport response)
        : calls(peer.writer("rq/govtwin/" + name + "Request", request)), replies(peer.reader("rr/govtwin/" + name + "Reply", response)) {}

    bool ask(Request& request, Response& response, int seconds = 5) {
        wait_for(calls, replies);
        eprosima::fastrtps::rtps::WriteParams params;
        calls->write(&request, params);
        SampleInfo info;
        const auto until = steady_clock::now() + std::chrono::seconds(seconds);
        while (steady_clock::now() < until) {
            while (replies->take_next_sample(&response, &info) == ReturnCode_t::RETCODE_OK) {
                if (info.valid_data && info.related_sample_identity == params.sample_identity()) return true;
            }
            std::this_thread::sleep_for(milliseconds(1));
        }
        return false;
    }
};

using namespace governor_msgs::msg::dds_;
using namespace sensor_msgs::msg::dds_;
using namespace rosgraph_msgs::msg::dds_;
using namespace simulation_interfaces::action::dds_;
using namespace action_msgs::srv::dds_;
using namespace rcl_interfaces::srv::dds_;

// The three inputs, once.
struct Inputs {
    DataWriter *command, *esv, *pressure;

    explicit Inputs(const Peer& peer)
        : command(peer.writer("rt/governor/command", TypeSupport(new GovernorCommand_PubSubType()))),
          esv(peer.writer("rt/governor/esv", TypeSupport(new EsvState_PubSubType()))),
          pressure(peer.writer("rt/governor/tank_pressure", TypeSupport(new FluidPressure_PubSubType()))) {
        for (auto* writer : {command, esv, pressure}) wait_for(writer, nullptr);
    }
    void tell(double opening) const {
        const auto ns = std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
        std_msgs::msg::dds_::Header_ header;
        header.stamp().sec(static_cast<int32_t>(ns / 1000000000));
        header.stamp().nanosec(static_cast<uint32_t>(ns % 1000000000));
        GovernorCommand_ wanted;
        wanted.header(header);
        wanted.opening(opening);
        command->write(&wanted);
        EsvState_ normal;
        normal.header(header);
        normal.state(1);
        esv->write(&normal);
        FluidPressure_ oil;
        oil.header(header);
        oil.fluid_pressure(6.3e6);
        pressure->write(&oil);
    }
};

static void steps(const Peer& peer) {
    Inputs inputs(peer);
    auto* feedbacks = peer.reader("rt/govtwin/simulate_steps/_action/feedback", TypeSupport(new SimulateSteps_FeedbackMessage_PubSubType()));
    auto* clocks = peer.reader("rt/clock", TypeSupport(new Clock_PubSubType()));
    const std::string at = "simulate_steps/_action/";
    Service<SimulateSteps_SendGoal_Request_, SimulateSteps_SendGoal_Response_> send(
        peer, at + "send_goal", TypeSupport(new SimulateSteps_SendGoal_Request_PubSubType()), TypeSupport(new SimulateSteps_SendGoal_Response_PubSubType()));
    Service<SimulateSteps_GetResult_Request_, SimulateSteps_GetResult_Response_> result(
        peer, at + "get_result", TypeSupport(new SimulateSteps_GetResult_Request_PubSubType()), TypeSupport(new SimulateSteps_GetResult_Response_PubSubType()));
    Service<CancelGoal_Request_, CancelGoal_Response_> cancel(
        peer, at + "cancel_goal", TypeSupport(new CancelGoal_Request_PubSubType()), TypeSupport(new CancelGoal_Response_PubSubType()));
    wait_for(nullptr, feedbacks);
    inputs.tell(0.3);
    std::this_thread::sleep_for(milliseconds(300));
    std::array<uint8_t, 16> one, two;
    one.fill(1);
    two.fill(2);
    SimulateSteps_SendGoal_Request_ goal;
    SimulateSteps_SendGoal_Response_ sent;
    goal.goal_id(one);
    goal.steps(2000);
    check("a goal is accepted", send.ask(goal, sent) && sent.accepted());
    SimulateSteps_GetResult_Request_ of;
    SimulateSteps_GetResult_Response_ ended;
    of.goal_id(one);
    const bool came = result.ask(of, ended, 15);
    check("its result comes once it is done", came && ended.status() == 4 && ended.result().result() == 1, "(status " + std::to_string(ended.status()) + ")");
    SimulateSteps_FeedbackMessage_ feedback;
    SampleInfo info;
    uint64_t done = 0, told = 0;
    bool rises = true;
    std::this_thread::sleep_for(milliseconds(200));
    while (feedbacks->take_next_sample(&feedback, &info) == ReturnCode_t::RETCODE_OK) {
        if (!info.valid_data) continue;
        rises = rises && feedback.completed_steps() >= done && feedback.completed_steps() + feedback.remaining_steps() == 2000;
        done = feedback.completed_steps();
        ++told;
    }
    check("feedback rises to the end", rises && done == 2000, "(" + std::to_string(told) + " times, " + std::to_string(done) + " steps)");
    Clock_ clock;
    int heard = 0;
    while (clocks->take_next_sample(&clock, &info) == ReturnCode_t::RETCODE_OK) heard += info.valid_data ? 1 : 0;
    check("its clock is heard", heard > 100 && clock.clock().sec() == 1 && clock.clock().nanosec() >= 990000000,
          "(" + std::to_string(heard) + " times, " + std::to_string(clock.clock().sec()) + "." + std::to_string(clock.clock().nanosec()) + " s)");
    goal.goal_id(two);
    goal.steps(500000000);
    check("a long goal is accepted", send.ask(goal, sent) && sent.accepted());
    CancelGoal_Request_ stop;
    CancelGoal_Response_ stopped;
    stop.goal_info().goal_id(two);
    check("and ended early", cancel.ask(stop, stopped) && stopped.return_code() == 0 && stopped.goals_canceling().size() == 1);
    of.goal_id(two);
    const bool told_so = result.ask(of, ended, 15);
    check("which is its result", told_so && ended.status() == 5, "(status " + std::to_string(ended.status()) + ")");

    Service<SetLoggerLevels_Request_, SetLoggerLevels_Response_> set(
        peer, "set_logger_levels", TypeSupport(new SetLoggerLevels_Request_PubSubType()), TypeSupport(new SetLoggerLevels_Response_PubSubType()));
    Service<GetLoggerLevels_Request_, GetLoggerLevels_Response_> get(
        peer, "get_logger_levels", TypeSupport(new GetLoggerLevels_Request_PubSubType()), TypeSupport(new GetLoggerLevels_Response_PubSubType()));
    SetLoggerLevels_Request_ levels;
    SetLoggerLevels_Response_ were_set;
    levels.levels().resize(2);
    levels.levels()[0].name("govtwin");
    levels.levels()[0].level(40);
    levels.levels()[1].name("other");
    levels.levels()[1].level(20);
    check("a logger's level is set, a stranger's refused", set.ask(levels, were_set) && were_set.results().size() == 2
          && were_set.results()[0].successful() && !were_set.results()[1].successful());
    GetLoggerLevels_Request_ names;
    GetLoggerLevels_Response_ are;
    names.names({"govtwin"});
    check("and told", get.ask(names, are) && are.levels().size() == 1 && are.levels()[0].level() == 40);
}

static void clock(const Peer& peer) {
    Inputs inputs(peer);
    auto* clocks = peer.writer("rt/clock", TypeSupport(new Clock_PubSubType()));
    auto* states = peer.reader("rt/sim/servo_state", TypeSupport(new ServoState_PubSubType()));
    wait_for(clocks, states);
    ServoState_ state;
    SampleInfo info;
    int answered = 0;
    for (int step = 1; step <= 300; ++step) {
        inputs.tell(step < 50 ? 0.3 : 0.5);
        Clock_ time;
        time.clock().sec(1000 + step / 100);
        time.clock().nanosec(step % 100 * 10000000);
        clocks->write(&time);
        const auto until = steady_clock::now() + milliseconds(500);
        bool mine = false;
        while (!mine && steady_clock::now() < until) {
            while (states->take_next_sample(&state, &info) == ReturnCode_t::RETCODE_OK) {
                const auto& stamp = state.header().stamp();
                mine = mine || (info.valid_data && stamp.sec() == time.clock().sec() && stamp.nanosec() == time.clock().nanosec());
            }
        }
        answered += mine ? 1 : 0;
    }
    check("each time of the clock is answered by its state", answered >= 295, "(" + std::to_string(answered) + " of 300)");
    check("and the command is followed", std::abs(state.servomotor_position() - 0.5) < 2e-3, "(" + std::to_string(state.servomotor_position()) + ")");
}

int main(int argc, char** argv) {
    const int domain = argc > 1 ? std::atoi(argv[1]) : 0;
    auto* participant = DomainParticipantFactory::get_instance()->create_participant(domain, PARTICIPANT_QOS_DEFAULT);
    if (participant == nullptr) {
        std::printf("FAIL cannot join domain %d\n", domain);
        return 1;
    }
    const Peer peer{participant, participant->create_publisher(PUBLISHER_QOS_DEFAULT), participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)};
    argc > 2 ? clock(peer) : steps(peer);
    participant->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant);
    std::printf("%d failed\n", failed);
    return failed;
}
