//! Words of names by which a column is one signal or another, in the languages of plants and manufacturers.

use crate::import::row::Target;
use crate::import::words::Words;

/// Words of names with what they speak for, and how much. Those of up to three letters count only as whole words.
pub(super) const WORDS: &[(Target, Words)] = &[
    (
        Target::OpeningCommand,
        Words(
            "opening_command 6|governorcommand 4|command 3|cmd 3|setpoint 3|set_point 3|sp 2.5|soll 3.5|demand 3|dmd 3|reference 2|ref 2|desired 2|\
             target 2|consigne 3|consigna 3|ypid 4|y_pid 4|leitapparat 1|gate 1|opening 1|referenc 2|referanse 3.5|riferimento 3|settpunkt 4|borvarde 4|\
             padrag 1|ledeapparat 1|ledskenor 1|distribuidor 1|导叶 1|给定 4|指令 4|设定 4|задан 4|уставк 4|开度 1|開度 1|abertura 1|apertura 1|ouverture 1",
        ),
    ),
    (
        Target::Esv,
        Words(
            "esv 5|esd 5|trip 4|emergency 4|shutdown 3|notschluss 5|schnellschluss 5|not_aus 4|notaus 4|estop 4|e_stop 4|86 3|urgence 4|arret 3|\
             disparo 4|stop 2|declench 4|scatto 4|ausgelost 3|sikkerhetsventil 5|parada 3|nodstopp 5|hurtigstopp 5|snabbstopp 5|emergenz 4|紧急 5|急停 5|\
             事故 4|停机 3|非常停止 5|аварий 4|останов 3",
        ),
    ),
    (
        Target::TankPressure,
        Words(
            "tank 3|accumulator 4|accu 2|windkessel 5|speicher 3|supply 2|pressure 2|druck 2|pression 2|presion 2|press 2|pres 2|oil 1|oilp 2|p 1|\
             accumul 4|acumulador 4|akkumul 4|ackumul 4|trykktank 3|trykk 2|oljetrykk 3|tryck 2|oljetryck 3|油压 3|油圧 3|压油罐 4|压力 2|давлен 2|мну 4",
        ),
    ),
    (
        Target::SpoolPosition,
        Words(
            "spool 5|distributing 4|hauptsteuer 5|steuerkolben 5|steuerventil 4|steuerschieber 5|main_valve 4|mainvalve 4|relay_valve 4|mdv 4|hsv 4|\
             tiroir 4|lvdt 2|slide 2|schieber 3|valvula_distribuidora 7|distribution_valve 5|corredera 4|carretel 4|cassetto 4|hovedventil 4|\
             hovedsleide 5|sleide 3|huvudslid 5|slid 3|主配 5|配圧弁 5|配压阀 4|золотник 5",
        ),
    ),
    (
        Target::ServomotorPosition,
        Words(
            "servomotor 5|servo 2|wicket 3|guide_vane 4|guidevane 4|gate 2|gv 2|leitapparat 4|leitrad 4|vannage 4|distributeur 4|ist 2.5|istwert 2.5|\
             feedback 2|actual 2|measured 1|opening 2|displacement 2|piston 3|cylinder 3|stroke 1.5|hub 1|position 1|pos 1|y 1|ledeapparat 4|ledskenor 4|\
             ledskena 4|distribuidor 4|distributor_position 2|palheta 3|servomoteur 5|arvarde 2.5|stilling 1|posisjon 1|posic 1|posiz 1|abertura 2|\
             apertura 2|ouverture 2|mesure 1|反馈 3|导叶 3|接力器 5|ガイドベーン 4|开度 2|開度 2|открыт 2|сервомотор 5",
        ),
    ),
    (
        Target::PilotValvePosition,
        Words(
            "pilot 4|proportional 4|prop 2|servovalve 3|servo_valve 3|vorsteuer 5|pv 2|coil 2|valve_current 3|先导 4|比例阀 4",
        ),
    ),
    (
        Target::ControlPressure,
        Words("control_pressure 6|steuerdruck 6|pilot_pressure 5|chamber 3|p_ctrl 5|p_control 5"),
    ),
];
