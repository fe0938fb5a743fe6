// A bench on Fast DDS against a running `govtwin run`: it commands, listens and asks for parameters.
//
// Prints what it checked and exits with the number of checks that failed. Usage: bench DOMAIN [watch | listen | calls]
// With `watch` it is a peer as tests/dds/watch.py is one: it commands 0.3 and 0.5 in turn after each silence of 2 s, and
// prints each half second how many states it received. Its lease is 2 s then.
// With `calls` it calls 50 times, each time as a client of a participant that is new, as soon as it sees the service.
// With `listen` it is one that comes late to a `govtwin watch`: it prints its verdict and the parts of its diagnostics.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <utility>

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
using std::chrono::duration;
using std::chrono::milliseconds;
using std::chrono::steady_clock;

static std_msgs::msg::dds_::Header_ now() {
    const auto ns = std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
    std_msgs::msg::dds_::Header_ header;
    header.stamp().sec(static_cast<int32_t>(ns / 1000000000));
    header.stamp().nanosec(static_cast<uint32_t>(ns % 1000000000));
    return header;
}

// The first call of a client that calls as soon as it sees the service, as rmw_fastrtps makes it: the request names the reader of the response.
static bool first_call(int domain) {
    using namespace rcl_interfaces::srv::dds_;
    auto* factory = DomainParticipantFactory::get_instance();
    auto* participant = factory->create_participant(domain, PARTICIPANT_QOS_DEFAULT);
    auto topic = [&](const char* name, TypeSupport type) {
        type.register_type(participant);
        return participant->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT);
    };
    DataReaderQos reading = DATAREADER_QOS_DEFAULT;
    reading.reliability().kind = RELIABLE_RELIABILITY_QOS;
    auto* replies = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(
        topic("rr/govtwin/get_parametersReply", TypeSupport(new GetParameters_Response_PubSubType())), reading);
    DataWriterQos writing = DATAWRITER_QOS_DEFAULT;
    writing.reliability().kind = RELIABLE_RELIABILITY_QOS;
    auto* call = participant->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(
        topic("rq/govtwin/get_parametersRequest", TypeSupport(new GetParameters_Request_PubSubType())), writing);
    auto until = steady_clock::now() + std::chrono::seconds(10);
    while (steady_clock::now() < until) {
        PublicationMatchedStatus out;
        SubscriptionMatchedStatus in;
        call->get_publication_matched_status(out);
        replies->get_subscription_matched_status(in);
        if (out.current_count > 0 && in.current_count > 0) break;
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    GetParameters_Request_ request;
    request.names({"hold"});
    eprosima::fastrtps::rtps::WriteParams params;
    params.related_sample_identity().writer_guid(replies->guid());
    call->write(&request, params);
    until = steady_clock::now() + std::chrono::seconds(2);
    bool answered = false;
    while (steady_clock::now() < until && !answered) {
        GetParameters_Response_ response;
        SampleInfo info;
        while (replies->take_next_sample(&response, &info) == ReturnCode_t::RETCODE_OK) {
            const auto& to = info.related_sample_identity;
            answered |= info.valid_data && to.writer_guid() == replies->guid() &&
                        to.sequence_number() == params.sample_identity().sequence_number();
        }
        std::this_thread::sleep_for(std::chrono::microseconds(500));
    }
    participant->delete_contained_entities();
    factory->delete_participant(participant);
    return answered;
}

int main(int argc, char** argv) {
    const int domain = argc > 1 ? std::atoi(argv[1]) : 0;
    const bool listening = argc > 2 && std::string(argv[2]) == "listen";
    const bool watching = argc > 2 && std::string(argv[2]) == "watch";
    if (argc > 2 && std::string(argv[2]) == "calls") {
        int answered = 0;
        for (int call = 0; call < 50; ++call) answered += first_call(domain) ? 1 : 0;
        check("50 first calls of new clients are answered", answered == 50, "(" + std::to_string(answered) + ")");
        return failed;
    }
    DomainParticipantQos own = PARTICIPANT_QOS_DEFAULT;
    if (watching) {
        own.wire_protocol().builtin.discovery_config.leaseDuration = eprosima::fastrtps::Duration_t(2, 0);
        own.wire_protocol().builtin.discovery_config.leaseDuration_announcementperiod = eprosima::fastrtps::Duration_t(0, 500000000);
    }
    auto* participant = DomainParticipantFactory::get_instance()->create_participant(domain, own);
    if (participant == nullptr) {
        std::printf("FAIL cannot join domain %d\n", domain);
        return 1;
    }
    auto* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    auto topic = [&](const char* name, TypeSupport type) {
        type.register_type(participant);
        return participant->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT);
    };
    auto writer = [&](const char* name, TypeSupport type) {
        DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
        qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
        return publisher->create_datawriter(topic(name, type), qos);
    };
    auto reader = [&](const char* name, TypeSupport type, bool reliable) {
        DataReaderQos qos = DATAREADER_QOS_DEFAULT;
        qos.reliability().kind = reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
        qos.history().depth = 10;
        return subscriber->create_datareader(topic(name, type), qos);
    };
    using namespace governor_msgs::msg::dds_;
    if (listening) {
        DataReaderQos late = DATAREADER_QOS_DEFAULT;
        late.reliability().kind = RELIABLE_RELIABILITY_QOS;
        late.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
        auto* verdicts = subscriber->create_datareader(
            topic("rt/govtwin_watch/verdict", TypeSupport(new UnitVerdict_PubSubType())), late);
        auto* diagnostics =
            reader("rt/diagnostics", TypeSupport(new diagnostic_msgs::msg::dds_::DiagnosticArray_PubSubType()), false);
        UnitVerdict_ verdict;
        diagnostic_msgs::msg::dds_::DiagnosticArray_ array;
        SampleInfo came;
        bool told = false, reported = false;
        for (int wait = 0; wait < 150 && !(told && reported); ++wait) {
            std::this_thread::sleep_for(milliseconds(100));
            if (verdicts->take_next_sample(&verdict, &came) == ReturnCode_t::RETCODE_OK && came.valid_data) {
                told = true;
                std::printf("verdict %s %s %s %u\n", verdict.header().frame_id().c_str(), verdict.process().c_str(),
                            verdict.verdict().c_str(), verdict.processes());
                for (const auto& size : verdict.sizes()) {
                    std::printf("size %s %.6g %.6g %.6g\n", size.effect().c_str(), size.value(), size.low(), size.high());
                }
            }
            if (diagnostics->take_next_sample(&array, &came) == ReturnCode_t::RETCODE_OK && came.valid_data) {
                reported = true;
                for (const auto& status : array.status()) {
                    std::printf("status %d %s\n", status.level(), status.name().c_str());
                }
            }
        }
        return told && reported ? 0 : 1;
    }
    auto* command = writer("rt/governor/command", TypeSupport(new GovernorCommand_PubSubType()));
    auto* esv = writer("rt/governor/esv", TypeSupport(new EsvState_PubSubType()));
    auto* pressure = writer("rt/governor/tank_pressure", TypeSupport(new sensor_msgs::msg::dds_::FluidPressure_PubSubType()));
    auto* states = reader("rt/sim/servo_state", TypeSupport(new ServoState_PubSubType()), false);
    using namespace rcl_interfaces::srv::dds_;
    auto* call = writer("rq/govtwin/get_parametersRequest", TypeSupport(new GetParameters_Request_PubSubType()));
    auto* replies = reader("rr/govtwin/get_parametersReply", TypeSupport(new GetParameters_Response_PubSubType()), true);

    auto* list_call = writer("rq/govtwin/list_parametersRequest", TypeSupport(new ListParameters_Request_PubSubType()));
    auto* lists = reader("rr/govtwin/list_parametersReply", TypeSupport(new ListParameters_Response_PubSubType()), true);

    ServoState_ state;
    SampleInfo info;
    int count = 0;
    auto drive = [&](double seconds, double opening, uint8_t valve) {
        const auto begin = steady_clock::now();
        const int steps = static_cast<int>(seconds * 100);
        for (int step = 0; step < steps; ++step) {
            GovernorCommand_ sample;
            sample.header(now());
            sample.opening(opening);
            command->write(&sample);
            if (step % 10 == 0) {
                sensor_msgs::msg::dds_::FluidPressure_ oil;
                oil.header(now());
                oil.fluid_pressure(6.3e6);
                pressure->write(&oil);
            }
            if (step % 50 == 0) {
                EsvState_ solenoid;
                solenoid.header(now());
                solenoid.state(valve);
                esv->write(&solenoid);
            }
            while (states->take_next_sample(&state, &info) == ReturnCode_t::RETCODE_OK) {
                count += info.valid_data ? 1 : 0;
            }
            std::this_thread::sleep_until(begin + milliseconds(10 * (step + 1)));
        }
    };

    if (watching) {
        const auto most = std::chrono::seconds(2);
        double openings[2] = {0.3, 0.5};
        auto told = steady_clock::now(), heard = told;
        bool ever = false;
        for (int printed = 0; printed < 600;) {
            const auto loop = steady_clock::now();
            const int before = count;
            drive(0.02, openings[0], 1);
            const auto at = steady_clock::now();
            const bool got = count > before;
            if ((ever && got && at - heard > most) || at - loop > most) {
                std::swap(openings[0], openings[1]);
                heard = at;
            }
            if (got) {
                ever = true;
                heard = at;
            }
            if (at - told >= milliseconds(500)) {
                std::printf("states %d at %.5f\n", count, state.servomotor_position());
                std::fflush(stdout);
                count = 0;
                told = at;
                ++printed;
            }
        }
        return 0;
    }
    for (int wait = 0; wait < 100; ++wait) {
        SubscriptionMatchedStatus matched;
        states->get_subscription_matched_status(matched);
        PublicationMatchedStatus heard;
        command->get_publication_matched_status(heard);
        if (matched.current_count > 0 && heard.current_count > 0) break;
        std::this_thread::sleep_for(milliseconds(100));
    }
    drive(2.0, 0.30, 1);
    check("states arrive", count > 100, "(" + std::to_string(count) + " in 2 s)");
    check("the servomotor stands at the first command", std::fabs(state.servomotor_position() - 0.30) < 2e-3,
          "(" + std::to_string(state.servomotor_position()) + ")");
    double widest = 0.0;
    count = 0;
    for (int piece = 0; piece < 40; ++piece) {
        drive(0.1, 0.50, 1);
        widest = std::fmax(widest, state.spool_position());
    }
    check("a step is followed to the new opening", std::fabs(state.servomotor_position() - 0.50) < 2e-3,
          "(" + std::to_string(state.servomotor_position()) + ")");
    check("the spool opened on the way", widest > 0.05, "(" + std::to_string(widest) + ")");

    bool answered = false;
    for (int attempt = 0; attempt < 10 && !answered; ++attempt) {
        GetParameters_Request_ request;
        request.names({"hold", "unit.servomotor.stroke_m"});
        eprosima::fastrtps::rtps::WriteParams params;
        call->write(&request, params);
        const auto until = steady_clock::now() + milliseconds(500);
        while (steady_clock::now() < until && !answered) {
            GetParameters_Response_ response;
            while (replies->take_next_sample(&response, &info) == ReturnCode_t::RETCODE_OK) {
                const bool mine = info.valid_data && info.related_sample_identity == params.sample_identity();
                if (mine && response.values().size() == 2 && response.values()[1].double_value() == 0.6) {
                    answered = true;
                }
            }
            std::this_thread::sleep_for(milliseconds(10));
        }
    }
    check("a Fast DDS caller gets parameters, its call named in the answer", answered);

    bool listed = false;
    size_t names = 0;
    for (int attempt = 0; attempt < 10 && !listed; ++attempt) {
        ListParameters_Request_ request;
        list_call->write(&request);
        const auto until = steady_clock::now() + milliseconds(500);
        while (steady_clock::now() < until && !listed) {
            ListParameters_Response_ response;
            while (lists->take_next_sample(&response, &info) == ReturnCode_t::RETCODE_OK) {
                names = info.valid_data ? response.names().size() : names;
                listed = names > 50;
            }
            std::this_thread::sleep_for(milliseconds(10));
        }
    }
    check("and the list of all parameters, which takes fragments", listed, "(" + std::to_string(names) + " names)");

    using namespace std_srvs::srv::dds_;
    using namespace simulation_interfaces::srv::dds_;
    // One call, sent once; what `right` says of the answer to it.
    auto ask = [&](DataWriter* to, DataReader* from, auto& request, auto& response, auto right) {
        for (int wait = 0; wait < 100; ++wait) {
            PublicationMatchedStatus out;
            SubscriptionMatchedStatus in;
            to->get_publication_matched_status(out);
            from->get_subscription_matched_status(in);
            if (out.current_count > 0 && in.current_count > 0) break;
            std::this_thread::sleep_for(milliseconds(100));
        }
        eprosima::fastrtps::rtps::WriteParams params;
        to->write(&request, params);
        const auto until = steady_clock::now() + std::chrono::seconds(5);
        while (steady_clock::now() < until) {
            while (from->take_next_sample(&response, &info) == ReturnCode_t::RETCODE_OK) {
                if (info.valid_data && info.related_sample_identity == params.sample_identity()) return right(response);
            }
            std::this_thread::sleep_for(milliseconds(1));
        }
        return false;
    };
    auto* reset = writer("rq/govtwin/resetRequest", TypeSupport(new Trigger_Request_PubSubType()));
    auto* was_reset = reader("rr/govtwin/resetReply", TypeSupport(new Trigger_Response_PubSubType()), true);
    auto* set = writer("rq/govtwin/set_simulation_stateRequest", TypeSupport(new SetSimulationState_Request_PubSubType()));
    auto* was_set = reader("rr/govtwin/set_simulation_stateReply", TypeSupport(new SetSimulationState_Response_PubSubType()), true);
    auto* step = writer("rq/govtwin/step_simulationRequest", TypeSupport(new StepSimulation_Request_PubSubType()));
    auto* was_step = reader("rr/govtwin/step_simulationReply", TypeSupport(new StepSimulation_Response_PubSubType()), true);
    Trigger_Request_ trigger;
    Trigger_Response_ triggered;
    check("a Fast DDS caller sets the twin back", ask(reset, was_reset, trigger, triggered, [](auto& answer) { return answer.success(); }));
    SetSimulationState_Request_ wanted;
    SetSimulationState_Response_ done;
    auto ok = [](auto& answer) { return answer.result().result() == 1; };
    wanted.state().state(2);
    check("pauses the simulation", ask(set, was_set, wanted, done, ok));
    StepSimulation_Request_ steps;
    StepSimulation_Response_ stepped;
    steps.steps(10);
    int exact = 0;
    const auto before = steady_clock::now();
    for (int round = 0; round < 100; ++round) exact += ask(step, was_step, steps, stepped, ok) ? 1 : 0;
    const double took = duration<double>(steady_clock::now() - before).count();
    check("steps it", exact == 100, "(" + std::to_string(exact) + " of 100 calls, " + std::to_string(10 * took) + " ms each)");
    wanted.state().state(1);
    check("and lets it play", ask(set, was_set, wanted, done, ok));

    drive(3.0, 0.50, 0);
    check("an ESV trip closes", state.servomotor_position() < 0.3,
          "(" + std::to_string(state.servomotor_position()) + ")");
    participant->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant);
    std::printf("%d failed\n", failed);
    return failed;
}
