MODULE Bohrbild
  ! Bohrbild Seitenwand links, Werkstück 4711, geprüft: Müller
  PERS tooldata tSpindle:=[TRUE,[[100,0,150],[0.923879533,0,-0.382683432,0]],[100,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wPanel:=[FALSE,TRUE,"",[[1500,0,500],[1,0,0,0]],[[300,-250,300],[1,0,0,0]]];
  CONST num nRückzug:=60;
  CONST robtarget pLoch1:=[[0.0,120.0,380.0],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];   ! größtes Loch
  CONST robtarget pLoch2:=[[0.0,170.0,380.0],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget pLoch3:=[[0.0,220.0,380.0],[0.707107,0,0.707107,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  PROC main()
    ! Höhe über dem Werkstück: 60 mm
    MoveJ Offs(pLoch1,-nRückzug,0,0),v500,z10,tSpindle\WObj:=wPanel;
    MoveL pLoch1,v50,fine,tSpindle\WObj:=wPanel;
    MoveL Offs(pLoch1,-nRückzug,0,0),v500,z10,tSpindle\WObj:=wPanel;
    MoveL Offs(pLoch2,-nRückzug,0,0),v500,z10,tSpindle\WObj:=wPanel;
    MoveL pLoch2,v50,fine,tSpindle\WObj:=wPanel;
    MoveL pLoch3,v50,fine,tSpindle\WObj:=wPanel;
  ENDPROC
ENDMODULE
