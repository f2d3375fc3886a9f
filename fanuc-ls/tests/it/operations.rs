//! The operations of instructions that public programs share. All other instructions stay text.

use fanuc_ls::{
    Attribute, Document, Expression, Function, Index, Instruction, Item, ItemKind, Operation, Operator,
    TimerAction,
};

fn operation(text: &str) -> Operation {
    Operation::decode(text).unwrap_or_else(|| panic!("{text}"))
}

fn item(kind: ItemKind, number: u32) -> Item {
    Item { kind, group: None, index: Index::Number(number), element: None, name: None }
}

fn register(number: u32) -> Expression {
    Expression::Item(item(ItemKind::Register, number))
}

fn binary(operator: Operator, left: Expression, right: Expression) -> Expression {
    Expression::Binary(operator, Box::new((left, right)))
}

fn equal(left: Expression, right: f64) -> Expression {
    binary(Operator::Equal, left, Expression::Number(right))
}

#[test]
fn calls_and_jumps() {
    use Expression::{Number, Text};
    let call = |program: &str, arguments| Operation::Call { program: program.to_string(), arguments };
    assert_eq!(operation("CALL WELD_ON    "), call("WELD_ON", vec![]));
    assert_eq!(
        operation("CALL MERGE(62,R[1],'a b')"),
        call("MERGE", vec![Number(62.0), register(1), Text("a b".into())])
    );
    assert_eq!(operation("CALL SR[25]"), call("SR[25]", vec![]));
    assert_eq!(operation("RUN LOGGER"), Operation::Run("LOGGER".into()));
    let label = Item { name: Some("DONE".into()), ..item(ItemKind::Label, 99) };
    assert_eq!(operation("LBL[99:DONE]"), Operation::Label(label.clone()));
    assert_eq!(operation("JMP LBL[99:DONE]"), Operation::Jump(label));
    let chosen =
        Item { index: Index::Item(Box::new(item(ItemKind::Register, 2))), ..item(ItemKind::Label, 0) };
    assert_eq!(operation("JMP LBL[R[2]]"), Operation::Jump(chosen));
    assert_eq!(
        [operation("END"), operation("ABORT"), operation("PAUSE")],
        [Operation::End, Operation::Abort, Operation::Pause]
    );
}

#[test]
fn registers_inputs_and_outputs() {
    use ItemKind::{DigitalOutput, Flag, PositionRegister, Register, Timer, UserTool};
    let named = |kind, number, name: &str| Item { name: Some(name.into()), ..item(kind, number) };
    let next = binary(Operator::Add, Expression::Item(named(Register, 1, "n: [a]")), Expression::Number(1.0));
    assert_eq!(operation("R[1:n: [a]]=R[1:n: [a]]+1"), Operation::Assign(named(Register, 1, "n: [a]"), next));
    assert_eq!(
        operation("DO[5:clamp]=ON"),
        Operation::Assign(named(DigitalOutput, 5, "clamp"), Expression::On)
    );
    assert_eq!(operation("F[1]=(OFF)"), Operation::Assign(item(Flag, 1), Expression::Off));
    assert_eq!(
        operation("PR[6]=LPOS"),
        Operation::Assign(item(PositionRegister, 6), Expression::CartesianPosition)
    );
    let element =
        Item { group: Some(4), element: Some(Index::Number(1)), ..named(PositionRegister, 69, "up") };
    assert_eq!(operation("PR[GP4:69,1:up]=(-115)"), Operation::Assign(element, Expression::Number(-115.0)));
    let moved = Operation::Assign(item(UserTool, 5), Expression::Item(item(PositionRegister, 10)));
    assert_eq!(operation("UTOOL[5] = PR[10]"), moved);
    assert_eq!(operation("DO[1]=PULSE,0.5sec"), Operation::Pulse(item(DigitalOutput, 1), Some(0.5)));
    assert_eq!(operation("DO[1]=PULSE"), Operation::Pulse(item(DigitalOutput, 1), None));
    assert_eq!(operation("TIMER[2]=RESET"), Operation::Timer(item(Timer, 2), TimerAction::Reset));
    let system = Operation::AssignSystem("$GROUP[1].$X".into(), Expression::System("$MCR.$Y".into()));
    assert_eq!(operation("$GROUP[1].$X=($MCR.$Y)"), system);
}

#[test]
fn frames_and_what_is_set() {
    assert_eq!(operation("UFRAME_NUM=R[3]"), Operation::UserFrame(register(3)));
    assert_eq!(operation("OVERRIDE=100%"), Operation::Override(Expression::Number(100.0)));
    assert_eq!(operation("PAYLOAD[1:gripper]"), Operation::Payload(Index::Number(1)));
    assert_eq!(operation("UALM[20]"), Operation::UserAlarm(Index::Number(20)));
    assert_eq!(operation("MESSAGE[a;b]"), Operation::Message("a;b".into()));
    assert_eq!(operation("//CALL A"), Operation::Disabled("CALL A".into()));
    assert_eq!(Instruction::UserTool(3).operation(), Some(Operation::UserTool(Expression::Number(3.0))));
    assert_eq!(Attribute::text("DEFAULT_GROUP", "1,*,1").groups(), Some(vec![true, false, true]));
    assert_eq!(Attribute::text("DEFAULT_GROUP", "?").groups(), None);
}

#[test]
fn waits() {
    let input = Expression::Item(item(ItemKind::DigitalInput, 1));
    assert_eq!(operation("WAIT    .50(sec)"), Operation::Wait(Expression::Number(0.5)));
    assert_eq!(operation("WAIT R[5]"), Operation::Wait(register(5)));
    let condition = binary(Operator::Equal, input.clone(), Expression::On);
    let timeout = Some(item(ItemKind::Label, 570));
    assert_eq!(operation("WAIT DI[1]=ON TIMEOUT,LBL[570]"), Operation::WaitFor { condition, timeout });
    let condition = Expression::Not(Box::new(input));
    assert_eq!(operation("WAIT (!DI[1])    "), Operation::WaitFor { condition, timeout: None });
}

#[test]
fn conditions_and_loops() {
    let jump = || Box::new(Operation::Jump(item(ItemKind::Label, 1)));
    let either = binary(
        Operator::Or,
        equal(register(1), 2.0),
        binary(
            Operator::And,
            equal(register(2), 3.0),
            binary(Operator::LessOrEqual, register(3), register(4)),
        ),
    );
    assert_eq!(operation("IF (R[1]=2 OR\nR[2]=3 AND R[3]<=R[4]),JMP LBL[1]"), Operation::If(either, jump()));
    // Without parentheses, a controller does not take both.
    assert_eq!(Operation::decode("IF R[1]=2 OR R[2]=3 AND R[3]<=R[4],JMP LBL[1]"), None);
    assert_eq!(operation("IF (R[1]=2) THEN"), Operation::IfThen(equal(register(1), 2.0)));
    assert_eq!([operation("ELSE"), operation("ENDIF")], [Operation::Else, Operation::EndIf]);
    let select = Operation::Select(item(ItemKind::Register, 1), Expression::Number(1.0), jump());
    assert_eq!(operation("SELECT R[1]=1,JMP LBL[1]"), select);
    assert_eq!(operation("=2,JMP LBL[1]"), Operation::Case(Expression::Number(2.0), jump()));
    assert_eq!(operation("ELSE,JMP LBL[1]"), Operation::Otherwise(jump()));
    let (counter, from, to) = (item(ItemKind::Register, 1), Expression::Number(9.0), register(2));
    assert_eq!(operation("FOR R[1]=9 DOWNTO R[2]"), Operation::For { counter, from, to, down: true });
    assert_eq!(operation("ENDFOR"), Operation::EndFor);
}

#[test]
fn what_binds_more_is_done_first() {
    let Operation::Assign(_, value) = operation("R[9]=R[1]-R[2]*R[3] DIV 2-1") else { panic!() };
    let product = binary(
        Operator::DivideWhole,
        binary(Operator::Multiply, register(2), register(3)),
        Expression::Number(2.0),
    );
    let difference = binary(Operator::Subtract, register(1), product);
    assert_eq!(value, binary(Operator::Subtract, difference, Expression::Number(1.0)));
    let Operation::Assign(_, value) = operation("R[9]=(R[1]-R[2])*(-R[3])") else { panic!() };
    let difference = binary(Operator::Subtract, register(1), register(2));
    let negative = Expression::Negative(Box::new(register(3)));
    assert_eq!(value, binary(Operator::Multiply, difference, negative));
}

#[test]
fn functions() {
    let call = |function, values| Expression::Call(function, values);
    let Operation::Assign(_, value) = operation("R[9]=-ABS[R[1]]+ATAN2(R[1],R[2])") else { panic!() };
    let negative = Expression::Negative(Box::new(call(Function::Abs, vec![register(1)])));
    let angle = call(Function::ArcTangent2, vec![register(1), register(2)]);
    assert_eq!(value, binary(Operator::Add, negative, angle));
    let text = || Expression::Item(item(ItemKind::StringRegister, 1));
    let Operation::Assign(_, value) = operation("SR[2]=SUBSTR SR[1],2,R[1]") else { panic!() };
    assert_eq!(value, call(Function::SubString, vec![text(), Expression::Number(2.0), register(1)]));
}

#[test]
fn other_instructions_of_the_table() {
    let command = |name, operands: Vec<Expression>, text: &str| Operation::Command {
        name,
        operands,
        text: text.into(),
    };
    assert_eq!(operation("COL GUARD ADJUST R[1]"), command("COL GUARD ADJUST", vec![register(1)], ""));
    assert_eq!(operation("SOFTFLOAT[1]"), command("SOFTFLOAT", vec![Expression::Number(1.0)], ""));
    assert_eq!(operation("SEND R[1]"), command("SEND", vec![register(1)], ""));
    assert_eq!(operation("RCV R[1], LBL[2]  "), command("RCV", vec![register(1)], "LBL[2]"));
    assert_eq!(operation("VISION RUN_FIND 'A'"), command("VISION RUN_FIND", vec![], "'A'"));
    assert_eq!(operation("LOCK PREG"), Operation::Lock);
    assert_eq!(operation("--eg:a"), Operation::Remark("eg:a".into()));
    assert_eq!(operation("MONITOR WATCH"), Operation::Monitor("WATCH".into()));
    let pallet = Expression::Pallet("[1,R[2],*]".into());
    assert_eq!(operation("PL[3]=[1,R[2],*]"), Operation::Assign(item(ItemKind::PalletRegister, 3), pallet));
    // A timer counts seconds.
    let seconds = binary(Operator::Divide, Expression::Number(500.0), Expression::Number(1000.0));
    assert_eq!(operation("TIMER[1]MS=500"), Operation::Assign(item(ItemKind::Timer, 1), seconds));
    let name = "Op. Entry Menu".to_string();
    assert_eq!(
        operation("Op. Entry Menu(1)"),
        Operation::Macro { name, arguments: vec![Expression::Number(1.0)] }
    );
    let jump = Box::new(Operation::Jump(Item { index: Index::Untaught, ..item(ItemKind::Label, 0) }));
    assert_eq!(operation("IF (...),JMP LBL[...]"), Operation::If(Expression::Untaught, jump));
    // As controllers set to German write them.
    let condition = Expression::Not(Box::new(Expression::Item(item(ItemKind::DigitalInput, 1))));
    assert_eq!(operation("WARTE (!E[1])"), Operation::WaitFor { condition, timeout: None });
    assert_eq!(operation("A[2]=AUS"), Operation::Assign(item(ItemKind::DigitalOutput, 2), Expression::Off));
}

#[test]
fn what_is_not_known_stays_text() {
    for text in [
        "",
        "R[1]",
        "R[1]=",
        "R[1]=(1",
        "R[1]=1)",
        "CALL",
        "JMP R[1]",
        "IF R[1]=1",
        "WAIT",
        "XX[1]=2",
        "R[1]=SIN R",
        "DO[1]=ONE",
        "TIMER[1]=STARTED",
        "PR[1,]=2",
        "P[R[]]=1",
        "CALL A(1",
        "PAYLOAD[1",
    ] {
        assert_eq!(Operation::decode(text), None, "{text}");
    }
    // Deeper and longer than any instruction.
    for text in [
        format!("R[1]={}1", "(".repeat(100_000)),
        format!("R[1]=1{}", "+1".repeat(100_000)),
        format!("{}1", "R[".repeat(100_000)),
    ] {
        assert_eq!(Operation::decode(&text), None);
    }
    assert_eq!(Instruction::Comment("CALL A".into()).operation(), None);
}

#[test]
fn the_offset_of_a_motion_is_a_position_register() {
    let document = Document::decode(
        "/PROG A\n/MN\n 1:L P[1] 5mm/sec FINE Tool_Offset,PR[8:grip] ACC50 Offset,PR[R[2]] ;\n/END",
    )
    .unwrap();
    let Some(Instruction::Motion(motion)) = document.instruction(0) else { panic!() };
    let chosen = Index::Item(Box::new(item(ItemKind::Register, 2)));
    assert_eq!(motion.offset(), Some(Item { index: chosen, ..item(ItemKind::PositionRegister, 0) }));
    assert_eq!(
        motion.tool_offset().map(|item| (item.index, item.name)),
        Some((Index::Number(8), Some("grip".into())))
    );
}

#[test]
fn options_are_read_to_their_end() {
    let options = |text: &str| {
        let line = format!("L P[1] 10mm/sec FINE {text}");
        let Some(Instruction::Motion(motion)) = Instruction::from_text(&line) else { panic!("{text}") };
        motion.each_option().into_iter().map(String::from).collect::<Vec<_>>()
    };
    assert_eq!(options("ACC50 Offset,PR[1:Z offset] PTH"), ["ACC50", "Offset,PR[1:Z offset]", "PTH"]);
    assert_eq!(
        options("Skip,LBL[2:not found],PR[3]=LPOS TB .50sec,CALL A(1,2)"),
        ["Skip,LBL[2:not found],PR[3]=LPOS", "TB .50sec,CALL A(1,2)"]
    );
    assert_eq!(options("ACC50 XYZ[1] PTH"), ["ACC50", "XYZ[1] PTH"]);
    assert_eq!(options(""), [""; 0]);
}

#[test]
fn what_is_named_ends_with_its_brackets() {
    let system = |text: &str| match operation(text) {
        Operation::AssignSystem(variable, Expression::Number(5.0)) => variable,
        other => panic!("{text}: {other:?}"),
    };
    assert_eq!(system("$A = 5"), "$A");
    assert_eq!(system("$A[1] = 5"), "$A[1]");
    assert_eq!(system("$A[1, 2].$B[3] =5"), "$A[1, 2].$B[3]");
    assert_eq!(Operation::decode("$=5"), None);
    let call = Operation::Call { program: "SR[25]".into(), arguments: vec![Expression::Number(1.0)] };
    assert_eq!(operation("CALL SR[25](1)"), call);
    let label = Item { name: Some("DONE".into()), ..item(ItemKind::Label, 99) };
    assert_eq!(operation("LBL[99:DONE]  "), Operation::Label(label));
}

#[test]
fn the_longest_instruction_has_4000_bytes() {
    let text = |length: usize| format!("MESSAGE[{}]", "a".repeat(length - "MESSAGE[]".len()));
    assert!(matches!(operation(&text(4000)), Operation::Message(_)));
    assert_eq!(Operation::decode(&text(4001)), None);
}
